"""Commands of the README and the how-to pages that take seconds, run as they stand on a small case, one page after the other.

What takes minutes (analyze, segment, identify, plan, batch) is parsed by test_readme_commands.py and run on small cases of its own.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from dicom_cases import pair
from phantoms import affine
from test_readme_commands import TOP, shown, shown_by

from palpate.ui.cli import main as cli
from palpate.ui.export import exporter

QUICK = ("export", "import", "report")
PAGES = ["README.md", *(f"docs/how_to/{name}.md" for name in ("correct_contours", "export", "plan", "own_scans"))]


def meant(folder: Path) -> dict[str, str]:
    """What a reader puts in the place of a word. The small phantom has no bones to be aligned on."""
    case = folder / "case"
    return {
        "REST": str(case / "rest_ct"), "DEFORMED": str(case / "deformed_ct"), "CASE": str(case), "DIR": str(folder / "out"),
        "REST_CONTOURS": str(folder / "given" / "rest_seg.dcm"), "DEFORMED_CONTOURS": str(folder / "given" / "deformed_seg.dcm"),
        "CASE2": str(folder / "case2"), "DIR/rest_labels.seg.nrrd": str(folder / "out" / "rest_labels.seg.nrrd"),
    }  # fmt: skip


def lines_of(page: str) -> list[list[str]]:
    found = shown() if page == "README.md" else shown_by(TOP / page)
    return [line for line in found if line[0] in QUICK and "--help" not in line]


@pytest.mark.parametrize("page", PAGES)
def test_the_quick_commands_of_a_page_run_as_they_stand(page: str, tmp_path: Path) -> None:
    case = pair(tmp_path / "case", affine())
    exporter("dicom-seg").export(case, tmp_path / "given")
    words, lines = meant(tmp_path), lines_of(page)
    assert lines
    for number, line in enumerate(lines):
        typed = [words.get(word, word) for word in line]
        if line[0] == "import":
            typed += ["--no-align"] if "DEFORMED" in line else []
            # A page may import into CASE itself; here that is there already.
            typed = [str(tmp_path / f"new_{number}") if word == words["CASE"] else word for word in typed]
        assert cli.main([*typed, "--quiet"]) == 0, " ".join(line)
        if line[0] == "export":
            assert any((tmp_path / "out").iterdir())


def test_the_pages_show_most_of_what_is_quick() -> None:
    assert {line[0] for page in PAGES for line in lines_of(page)} == set(QUICK)
