"""The site of the documentation: its generated pages are the code's, its menu is whole, and it needs no network."""

import importlib
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import experiments_page
import notebook_page
import options_page
import pytest
import recordings_page
import settings_page
import yaml

import bilateral_rl
from bilateral_rl.config.schema import CONFIGS

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"


@pytest.mark.parametrize(
    "script",
    [notebook_page, settings_page, experiments_page, options_page, recordings_page],
    ids=lambda script: script.__name__,
)
def test_a_generated_page_says_what_the_code_says(script):
    told = f"run python docs/scripts/{script.__name__}.py, and look at what changed"
    assert script.PAGE.read_text(encoding="utf-8") == script.page(), told


@pytest.mark.parametrize("algo", CONFIGS)
def test_every_setting_is_described(algo):
    settings = dict(settings_page.settings(algo))
    assert len(settings) > 40
    assert all(len(setting.description) > 10 for setting in settings.values())
    assert settings_page.unit(settings["trial.max_load"].description) == "N"


def menu():
    """The pages that mkdocs.yml names, without asking MkDocs."""

    class Loader(yaml.SafeLoader):
        pass

    Loader.add_multi_constructor("tag:yaml.org,2002:python/", lambda *_: None)
    nav = yaml.load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"), Loader)["nav"]
    return list(_pages(nav))


def _pages(entry):
    if isinstance(entry, str):
        yield entry
    else:
        for inner in entry.values() if isinstance(entry, dict) else entry:
            yield from _pages(inner)


def test_the_menu_names_every_page_once():
    made_elsewhere = {"changelog.md", "contributing.md", "examples.md", "runs.md"}
    pages = {page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md")}
    assert sorted(menu()) == sorted(pages | made_elsewhere)


@pytest.mark.parametrize("page", ["index", "envs", "algorithms", "policies"])
def test_the_interface_has_every_public_name(page):
    room = bilateral_rl if page == "index" else importlib.import_module(f"bilateral_rl.{page}")
    shown = re.findall(
        rf"^::: {room.__name__}\.(\w+)$", (DOCS / f"api/{page}.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    public = {*room.__all__} - {"__version__", "envs", "algorithms", "policies"}
    assert sorted(shown) == sorted(public), f"docs/api/{page}.md needs a line '::: {room.__name__}.NAME' for each"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    pytest.importorskip("mkdocstrings", reason="the site is built with the extra docs")
    folder = tmp_path_factory.mktemp("site")
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(build, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


class Loaded(HTMLParser):
    """What a page loads as soon as it is opened."""

    def __init__(self):
        super().__init__()
        self.urls = []

    def handle_starttag(self, tag, attrs):
        name = {"script": "src", "img": "src", "iframe": "src", "link": "href"}.get(tag)
        self.urls += [value for key, value in attrs if key == name]


def test_no_page_loads_anything_from_elsewhere(site):
    pages = sorted({*site.rglob("*.html")} - {site / "404.html"})  # which a server shows, whatever the folder
    assert len(pages) > 15
    for page in pages:
        parser = Loaded()
        parser.feed(page.read_text(encoding="utf-8"))
        assert parser.urls
        for url in parser.urls:
            assert not re.match(r"(https?:)?//", url), f"{page}: {url}"
            assert (page.parent / url.partition("?")[0].partition("#")[0]).exists(), f"{page}: {url}"


def test_style_sheets_load_nothing_from_elsewhere(site):
    for sheet in site.rglob("*.css"):
        assert not re.search(r"(url\(|@import)\s*['\"]?(https?:)?//", sheet.read_text(encoding="utf-8")), sheet


def test_the_search_works_from_a_folder(site):
    index = (site / "search" / "search_index.js").read_text(encoding="utf-8")
    assert index.startswith("var __index")
    assert "non-dominant" in index
    assert (site / "assets" / "iframe-worker.js").exists()
