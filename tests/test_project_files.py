"""The files by which others join the project say the same as the code."""

import re
from pathlib import Path

import yaml
from rooms import FLOORS

import bilateral_rl

ROOT = Path(__file__).parents[1]


def read(name):
    return (ROOT / name).read_text(encoding="utf-8")


def test_the_map_of_rooms_is_the_one_that_is_tested():
    rows = re.findall(r"^\| (\d) \| `(\w+)` \|", read("CONTRIBUTING.md"), re.MULTILINE)
    expected = [(str(number), room) for number, floor in enumerate(FLOORS, start=1) for room in floor]
    assert sorted(rows) == sorted(expected)
    for number, floor in enumerate(FLOORS, start=1):
        assert [room for floor_, room in rows if floor_ == str(number)] == floor


def test_the_citation_is_complete_and_of_this_version():
    citation = yaml.safe_load(read("CITATION.cff"))
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()
    assert (citation["cff-version"], citation["license"]) == ("1.2.0", "MIT")
    assert citation["version"] == bilateral_rl.__version__
    (paper,) = citation["references"]
    assert {"type", "title", "authors"} <= paper.keys()
    assert "arXiv:2401.14057" in {identifier["value"] for identifier in paper["identifiers"]}


def test_the_changelog_has_an_entry_for_this_version():
    assert re.search(rf"^## .*\b{re.escape(bilateral_rl.__version__)}\b", read("CHANGELOG.md"), re.MULTILINE)


def test_the_workflow_runs_on_every_python_that_the_package_names():
    named = re.findall(r"Python :: (3\.\d+)", read("pyproject.toml"))
    workflow = yaml.safe_load(read(".github/workflows/ci.yml"))
    assert workflow["jobs"]["linux"]["strategy"]["matrix"]["python"] == named
