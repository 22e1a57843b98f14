"""What MkDocs is told of this repository: pages that lie outside of docs/, and where their links lead in the site.

Every page keeps links that work where the repository is browsed. Here they are turned into links of the site: to the
page that a file became, or, for a file that is no page, to nothing.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]

OUTSIDE = {
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "examples/README.md": "examples.md",
    "runs/README.md": "runs.md",
}
"""Files outside of docs/ that are pages of the site."""
PLACES = OUTSIDE | {"README.md": "index.md"}
"""Where links to files outside of docs/ lead."""

LINK = re.compile(r"\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that lie outside of docs/."""
    for source, uri in OUTSIDE.items():
        files.append(File.generated(config, uri, content=_text(source)))
    for notebook in sorted(ROOT.glob("examples/*.ipynb")):
        files.append(File.generated(config, f"examples/{notebook.name}", content=notebook.read_text(encoding="utf-8")))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Let links lead where the files that they name are in the site."""
    source = next((file for file, uri in OUTSIDE.items() if uri == page.file.src_uri), f"docs/{page.file.src_uri}")
    return LINK.sub(lambda link: _relinked(link, source, page.file.src_uri), markdown)


def _relinked(link: re.Match[str], source: str, uri: str) -> str:
    words, target = link.groups()
    path, hash_, anchor = target.partition("#")
    if not path or ":" in path:
        return link[0]
    file = posixpath.normpath(posixpath.join(posixpath.dirname(source), path))
    if file.startswith("docs/"):
        place = file.removeprefix("docs/")
    elif file in PLACES:
        place = PLACES[file]
    elif file.endswith(".ipynb"):
        place = file
    elif (ROOT / file).exists():
        return words
    else:
        raise FileNotFoundError(f"{source} links to {target}, which does not exist.")
    return f"[{words}]({posixpath.relpath(place, posixpath.dirname(uri))}{hash_}{anchor})"


def _text(source: str) -> str:
    text = (ROOT / source).read_text(encoding="utf-8")
    if source == "examples/README.md":
        scripts = sorted(ROOT.glob("examples/*.py"))
        text = "---\nsearch:\n  boost: 0.2\n---\n" + text  # long scripts would stand before every explanation
        text += "".join(f"\n## {file.name}\n\n```python\n{file.read_text(encoding='utf-8')}```\n" for file in scripts)
    return text
