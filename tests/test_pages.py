"""What README, docs/ and examples/ show works as it stands there, and every link in a page leads somewhere."""

import re
import runpy
import shutil
from pathlib import Path

import pytest
import typer

from bilateral_rl.commands.app import app
from bilateral_rl.config.resolve import resolve
from bilateral_rl.training.run import train

ROOT = Path(__file__).parents[1]
PAGES = [path for pattern in ("*.md", "docs/**/*.md", "*/README.md") for path in sorted(ROOT.glob(pattern))]
TEXTS = {page.relative_to(ROOT).as_posix(): page.read_text(encoding="utf-8") for page in PAGES}
BLOCKS = [
    pytest.param(block, id=f"{page}-{number}")
    for page, text in TEXTS.items()
    if not page.startswith("docs/tutorials/")  # test_tutorials.py does those
    for number, block in enumerate(re.findall(r"```python\n(.*?)```", text, re.DOTALL))
]
EXAMPLES = sorted(ROOT.glob("examples/*.py"))


NETWORKS = {"runs/random_reach/cc_s-bptt-1": 4, "runs/random_reach/cc_s-ppo-1": 1}
"""The runs that scripts load, and how many networks are in each."""


@pytest.mark.parametrize("script", BLOCKS)
def test_a_script_in_a_page_runs(script, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, seeds in NETWORKS.items():
        if name in script:  # hardly trained, and by the fastest algorithm
            few = {"trials": 32, "batch_size": 16, "validation_trials": 4}
            run = train(resolve("bptt", None, [{"seeds": seeds, "epochs": 1, "bptt": few}]), tmp_path / "trained")
            shutil.copytree(run.folder.path, tmp_path / name)
    exec(script, {"__name__": "__main__"})


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(example, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(example), run_name="__main__")


def test_examples_are_listed_in_their_readme():
    listed = re.findall(r"^\| `(\w+\.py)` \|", TEXTS["examples/README.md"], re.MULTILINE)
    assert sorted(listed) == [path.name for path in EXAMPLES]


def test_every_command_shown_has_the_options_that_it_is_shown_with():
    commands = typer.main.get_group(app).commands
    lines = [
        line
        for text in TEXTS.values()
        for line in re.findall(r"^bilateral-rl (.*)$", text.replace("\\\n", " "), re.MULTILINE)
    ]
    shown = [line.split("#")[0].split() for line in lines]
    assert {name for name, *_ in shown} >= {*commands} - {"list"}
    for name, *words in shown:
        known = {option for one in commands[name].params for option in one.opts + one.secondary_opts}
        assert {word for word in words if word.startswith("--")} <= known, (name, words)


def test_the_page_on_commands_has_a_section_for_each():
    sections = re.findall(r"^## `(\w+)`", TEXTS["docs/commands.md"], re.MULTILINE)
    assert sections == list(typer.main.get_group(app).commands)


def test_the_page_on_the_study_of_two_arms_names_its_readings():
    table = re.search(r"^\| reading \|.*?\n\n", TEXTS["docs/two_arms_study.md"], re.DOTALL | re.MULTILINE)[0]
    named = [name for row in table.splitlines()[2:] if row for name in re.findall(r"`([\w.-]+)`", row.split("|")[1])]
    files = (ROOT / "bilateral_rl" / "readings" / "two_arms").glob("*.yaml")
    assert sorted(named) == sorted(path.stem for path in files)


def test_there_are_scripts():
    assert len(BLOCKS) >= 5
    assert len(EXAMPLES) >= 7


def test_every_link_leads_somewhere():
    for page, text in TEXTS.items():
        for link in re.findall(r"\]\(([^)]+)\)", re.sub(r"```.*?```", "", text, flags=re.DOTALL)):
            if link.startswith("https://"):
                continue
            file, _, anchor = link.partition("#")
            target = (ROOT / page).parent / file if file else ROOT / page
            assert target.exists(), f"{page}: {link}"
            assert not anchor or anchor in anchors(target), f"{page}: {link}"


def anchors(page):
    """The names by which a page's headings are linked, and what the site writes of the code."""
    text = page.read_text(encoding="utf-8")
    headings, code = (re.findall(line, text, re.MULTILINE) for line in (r"^#+ (.*)$", r"^::: (.*)$"))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings} | {*code}
