"""Hooks of MkDocs: pages made from the program itself, and equations as MathML, which browsers show without a script.

mkdocs.yml names this file. Made at every build, so that they cannot go stale: `reference/commands.md` from the parser's help,
`reference/diagnosis_numbers.md` from the option types,
`known_issues.md` from the file at the top of the repository, the tree that the Python reference is read from.
"""

from __future__ import annotations

import html
import posixpath
import re
import shutil
from pathlib import Path

import list_numbers
from commands_page import commands_page
from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

TOP = Path(__file__).parents[1]
ROOMS = ("core", "imaging", "segmentation", "meshing", "simulate", "case", "validate", "ui", "applications")
API = TOP / "build" / "api"
# Files outside docs/ that the site shows too: file of the repository -> file of the site.
BORROWED = {
    "KNOWN_ISSUES.md": "known_issues.md",
    "plugin/Screenshots/PalpateStiffness.png": "tutorial/pictures/slicer_result.png",
}
_PICTURE = re.compile(r'(<img [^>]*src="([^"]+)"[^>]*>)')
_MATH = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_startup(command: str, dirty: bool) -> None:
    """Copy the rooms under one `palpate` folder, where the Python reference looks for them."""
    shutil.rmtree(API, ignore_errors=True)
    only_python = shutil.ignore_patterns("__pycache__", "*.html", "*.css")
    shutil.copytree(TOP / "palpate", API / "palpate", ignore=only_python)
    for room in ROOMS:
        shutil.copytree(TOP / room, API / "palpate" / room, ignore=only_python)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made here."""
    files.append(File.generated(config, "reference/commands.md", content=commands_page()))
    files.append(File.generated(config, "reference/diagnosis_numbers.md", content=list_numbers.page()))
    for source, page in BORROWED.items():
        files.append(File.generated(config, page, abs_src_path=str(TOP / source)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Point links to borrowed files at the site's copies."""
    here = posixpath.dirname(page.file.src_uri)
    for source, name in BORROWED.items():
        markdown = re.sub(rf"\((\.\./)+{re.escape(source)}", f"({posixpath.relpath(name, here or '.')}", markdown)
    # A page of the repository's top names the others by their folder.
    return markdown.replace("](docs/", "](") if page.file.src_uri in BORROWED.values() else markdown


def on_page_content(html_text: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Equations as MathML; each picture opens at its own size, since the column is narrower than a screenshot."""
    return _MATH.sub(_mathml, _PICTURE.sub(r'<a href="\2">\1</a>', html_text))


def _mathml(found: re.Match[str]) -> str:
    display = "block" if found[2] == "[" else "inline"
    return convert(html.unescape(found[3]).strip(), display=display)
