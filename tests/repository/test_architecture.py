"""The map of the repository is that of the repository: its picture shows the imports, its pages name files that are there."""

from __future__ import annotations

import importlib.util
import re
import runpy
from pathlib import Path
from types import ModuleType

import pytest
from rooms import ROOMS

TOP = Path(__file__).parents[2]
PAGES = [
    *(
        "ARCHITECTURE.md",
        "CONTRIBUTING.md",
        "README.md",
        "KNOWN_ISSUES.md",
        "plugin/README.md",
        "sample_dicom/README.md",
    ),
    *sorted(page.relative_to(TOP).as_posix() for page in (TOP / "docs").rglob("*.md")),
]
# A path that begins with a folder at the top of the repository.
_TOPS = "|".join([*ROOMS, "docs", "tests", "plugin", "palpate", "sample_dicom", r"\.ci"])
_PATH = re.compile(rf"(?<![\w./-])((?:{_TOPS})/[\w./-]*\w)")

# "Walker & Ni 2011", "Teran et al. 2005", "Schwarz 1978", "Grady, PAMI 2006": the last name and the year.
_CITED = re.compile(r"\b([A-Z][a-z]+[A-Za-z]*)(?: et al\.)?,?(?: [A-Z]{4})? \(?((?:19|20)\d{2})\b")


def _plain(text: str) -> str:
    """Without accents' commands and in lower case; umlauts as the code writes them."""
    text = text.lower().replace('{\\"o}', "oe").replace('{\\"u}', "ue").replace(r"{\ae}", "ae").replace(r"{\'e}", "e")
    return text.replace(r"{\'o}", "o").replace("{", "").replace("}", "")


def drawing() -> ModuleType:
    """The script that draws the picture."""
    spec = importlib.util.spec_from_file_location("draw_architecture", TOP / "docs" / "draw_architecture.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_picture_shows_which_room_imports_which() -> None:
    """Pairs of rooms, not their counts, which change with every file; none runs up."""
    module = drawing()
    shown = set(module.drawn(module.PICTURE.read_text(encoding="utf-8")))
    assert shown == set(module.imports()), "run .venv/bin/python docs/draw_architecture.py"
    assert all(module.runs_down(*pair) for pair in shown)


def test_the_picture_reads_every_form_of_import(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = drawing()
    lines = {
        "a": "import palpate.core.mesh",
        "b": "def f():\n    from palpate.imaging import volume",
        "c": "from palpate import meshing",
        "d": "import core, numpy",
    }
    (tmp_path / "ui").mkdir()
    for name, text in lines.items():
        (tmp_path / "ui" / f"{name}.py").write_text(text)
    monkeypatch.setattr(module, "TOP", tmp_path)
    assert module.imports() == {("ui", "core"): 1, ("ui", "imaging"): 1, ("ui", "meshing"): 1}


@pytest.mark.parametrize("page", PAGES)
def test_a_page_names_files_that_are_there(page: str) -> None:
    text = (TOP / page).read_text(encoding="utf-8")
    gone = [name for name in _PATH.findall(text) if not (TOP / name).exists()]
    assert not gone


def test_the_files_that_are_tested_first_are_there() -> None:
    """A file that was moved would silently be begun last again."""
    longest = runpy.run_path(str(TOP / "tests" / "conftest.py"))["LONGEST"]
    assert len(set(longest)) == len(longest) > 10
    assert [name for name in longest if not (TOP / name).is_file()] == []


def test_references_name_files_that_cite_them() -> None:
    text = (TOP / "docs" / "references.bib").read_text(encoding="utf-8")
    named = [name for line in re.findall(r"keywords\s*= \{(.*)\}", text) for name in line.split(", ")]
    assert named and [name for name in named if not (TOP / name).is_file()] == []


@pytest.mark.parametrize("room", ROOMS)
def test_what_the_code_cites_by_name_and_year_is_in_the_references(room: str) -> None:
    entries = (TOP / "docs" / "references.bib").read_text(encoding="utf-8").split("\n@")
    cited = {
        (name, year, path.relative_to(TOP).as_posix())
        for path in (TOP / room).rglob("*.py")
        for name, year in _CITED.findall(path.read_text(encoding="utf-8"))
    }
    plain = [_plain(entry) for entry in entries]
    missing = [
        c for c in cited if not any(c[1] in entry and re.search(rf"\b{_plain(c[0])}\b", entry) for entry in plain)
    ]
    assert missing == [], "add them to docs/references.bib"


@pytest.mark.parametrize("room", ROOMS)
def test_the_map_names_every_folder_of_a_room(room: str) -> None:
    page = (TOP / "ARCHITECTURE.md").read_text(encoding="utf-8")
    folders = sorted(init.parent.name for init in (TOP / room).glob("*/__init__.py"))
    assert [name for name in folders if f"`{name}`" not in page] == []
