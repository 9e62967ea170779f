"""Pages of people hold to the program: figures once and from one file, links that lead somewhere, commands and code that work."""

from __future__ import annotations

import importlib.util
import itertools
import re
import sys
from collections.abc import Callable
from datetime import date
from pathlib import Path
from types import ModuleType

import matplotlib as mpl
import pytest
from phantoms import affine, labels, result

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.ui.cli.commands.validate import STUDIES
from palpate.ui.cli.main import COMMANDS
from palpate.ui.desktop.scripting.commands_script import parse
from palpate.ui.export import names

TOP = Path(__file__).parents[2]
DOCS = TOP / "docs"
PAGES = [TOP / "README.md", TOP / "KNOWN_ISSUES.md", *sorted(DOCS.rglob("*.md"))]
OF_THE_CODE = [TOP / "ARCHITECTURE.md", TOP / "CONTRIBUTING.md"]
SPOKEN = [*PAGES, *OF_THE_CODE, TOP / "sample_dicom" / "README.md", TOP / "plugin" / "README.md"]
# Made at every build of the site (docs/site_hooks.py), so they lie in no folder.
MADE = {DOCS / "reference" / "commands.md", DOCS / "reference" / "diagnosis_numbers.md"}


def script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


def test_pages_of_figures_are_what_their_script_writes() -> None:
    for page, text in script("write_measured").written().items():
        assert (DOCS / page).read_text(encoding="utf-8") == text, "run .venv/bin/python docs/write_measured.py"


def test_a_figure_stands_on_one_page_only() -> None:
    """Its name and value, which no other page repeats."""
    for section in script("write_measured").sections():
        for row in (row for run in section.runs for row in run.rows):
            found = [p for p in PAGES if f"| {' | '.join(row)} |" in p.read_text(encoding="utf-8")]
            assert found == [DOCS / section.page], row


def test_a_cell_of_the_measured_tables_holds_one_figure() -> None:
    for section in script("write_measured").sections():
        for cell in (cell for run in section.runs for row in run.rows for cell in row[1:]):
            assert not re.search(r"[;,]| and | to ", cell), cell


def test_a_figure_without_its_command_is_refused(tmp_path: Path) -> None:
    written = '[[section]]\nid = "a"\ntitle = "A"\nnote = ""\n[[section.run]]\nrows = [["x", "1"]]\ndate = 2026-01-01\n'
    (tmp_path / "measured.toml").write_text(written)
    with pytest.raises(TypeError, match="command"):
        script("write_measured").sections(tmp_path / "measured.toml")


def test_studies_stand_side_by_side_and_their_counts_are_added() -> None:
    write = script("write_measured")
    study = {"command": "palpate doctor", "date": date(2026, 1, 2), "commit": "abc"}
    first = write.Study(title="first", found={"hits": "3 of 4", "p": "0.1"}, **study)
    second = write.Study(title="second", found={"hits": "5 of 6: one lost", "p": "0.2"}, **study)
    rows = write.side_by_side([first, second]).splitlines()
    assert rows[0] == "| what | first | second | together |"
    assert rows[2:4] == ["| hits | 3 of 4 | 5 of 6: one lost | 8 of 10 |", "| p | 0.1 | 0.2 |  |"]
    assert rows[-1] == "- second: `palpate doctor` (2026-01-02, `abc`)"
    with pytest.raises(ValueError, match="other things"):
        write.side_by_side([first, write.Study(title="third", found={"p": "0.3"}, **study)])


def test_the_readme_is_short() -> None:
    assert len((TOP / "README.md").read_text(encoding="utf-8").split()) <= 900


def test_known_issues_are_few() -> None:
    text = (TOP / "KNOWN_ISSUES.md").read_text(encoding="utf-8")
    numbers = [int(number) for number in re.findall(r"^(\d+)\. ", text, re.MULTILINE)]
    assert numbers == list(range(1, len(numbers) + 1)) and 10 < len(numbers) <= 25
    for entry in re.split(r"^\d+\. ", text, flags=re.MULTILINE)[1:]:
        issue, way = re.fullmatch(r"\*\*(.+?)\*\* \*Way round:\* (.+)", " ".join(entry.split())).groups()  # type: ignore[union-attr]
        assert len(re.findall(r"[.!?](?=\s|$)", issue)) == 1 and way.endswith("."), "one sentence, and a way round"


def spoken(page: Path) -> list[str]:
    """Lines of code that a page shows, in blocks and in the text; a line that goes on is one."""
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    blocks = re.findall(r"^```(?:sh|text)?\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    rest = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    indented = re.findall(r"^    (palpate .+)$", rest, re.MULTILINE)
    return [line for block in blocks for line in block.splitlines()] + indented + re.findall(r"`([^`\n]+)`", rest)


def unknown_in(line: str) -> str:
    """What of a command is not there: the command, an option, a study, a file of the repository; "" where all is."""
    command = re.match(r"(?:\./run )?palpate (?!\.)([a-z]+)\b(.*)", line.partition("#")[0])
    if command is None:
        files = re.findall(r"(?:python|\./run test) ((?:docs|plugin|tests)/[\w/.]+)", line)
        return next((name for name in files if not (TOP / name).exists()), "")
    name, words = command.groups()
    if name not in COMMANDS:
        return name
    parser = script("commands_page")._parser_of(name)
    known = {flag for action in parser._actions for flag in action.option_strings}
    missing = [flag for flag in re.findall(r"(?<![\w-])--[a-z][\w-]*", words) if flag not in known]
    study = re.match(r" ([a-z]\w+)", words)
    missing += [study[1]] if name == "validate" and study is not None and study[1] not in STUDIES else []
    return " ".join(missing)


@pytest.mark.parametrize("page", SPOKEN, ids=lambda page: page.relative_to(TOP).as_posix())
def test_every_command_on_a_page_exists(page: Path) -> None:
    unknown = {line: found for line in spoken(page) if (found := unknown_in(line))}
    assert not unknown


def test_a_command_that_is_gone_is_seen() -> None:
    assert unknown_in("./run palpate analyse A B -o CASE") == "analyse"
    assert unknown_in("palpate identify CASE --againn x") == "--againn"
    assert unknown_in("palpate validate gapp --cases 3") == "gapp"
    assert unknown_in(".venv/bin/python docs/write_sampel.py") == "docs/write_sampel.py"
    assert not unknown_in("./run palpate validate gap --cases 3 --seed 4 --workers 1")


def test_the_pages_are_short() -> None:
    """What a person may read to the end: the pages of docs, README, known issues, and the two for who changes the code."""
    assert sum(len(page.read_text(encoding="utf-8").split()) for page in [*PAGES, *OF_THE_CODE]) <= 15_000


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as the site and GitHub make them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading).strip().lower().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(TOP).as_posix())
def test_links_and_pictures_lead_somewhere(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        name, _, anchor = target.partition("#")
        there = (page.parent / name).resolve() if name else page
        assert there in MADE or there.exists(), target
        assert not anchor or there in MADE or anchor in anchors(there), target


def test_no_list_runs_into_the_text_before_it() -> None:
    """The site's Markdown begins a list after an empty line only, and nests by four spaces."""
    item = re.compile(r"( *)([-*]|\d+\.) ")
    for page in PAGES:
        text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        lines = text.splitlines()
        for before, line in itertools.pairwise(lines):
            found, above = item.match(line), item.match(before)
            deeper = found is not None and above is not None and len(found[1]) > len(above[1])
            continues = (
                found is not None
                and above is None
                and before.strip()
                and not before.startswith(" " * (len(found[1]) + 2))
            )
            assert not deeper and not continues, f"{page}: {line}"


def test_the_page_of_exports_names_every_form() -> None:
    page = (DOCS / "how_to" / "export.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `([\w-]+)` \|", page, re.MULTILINE)) == set(names())


def test_the_page_of_commands_has_every_command_and_option() -> None:
    page = script("commands_page").commands_page()
    assert re.findall(r"^## (\w+)$", page, re.MULTILINE) == list(COMMANDS)
    assert all(
        option in page for option in ("--rest-labels FILE", "N&#124;NAME=X,Y,Z", "--to {dicom-pdf", "--workers N")
    )


@pytest.mark.parametrize("name", ["window_pictures.txt", "window_swarm.txt"])
def test_the_scripts_of_the_window_pictures_are_understood(name: str) -> None:
    path = DOCS / "tutorial" / name
    commands = parse(path.read_text(encoding="utf-8"), str(path))
    assert {"open", "show", "screenshot", "quit"} <= {command.name for command in commands}


@pytest.fixture
def demo_case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A case of the name that the tutorial uses, in the working folder."""
    monkeypatch.chdir(tmp_path)
    case = CaseFolder.create("demo_case", CaseFacts("demo"))
    case.write_labels("rest", labels(affine()))
    case.write_json("result.json", result())
    return tmp_path


def test_the_code_of_the_python_tutorial_runs(demo_case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (DOCS / "tutorial" / "python.md").read_text(encoding="utf-8")
    mpl.use("Agg")
    known: dict[str, Callable[..., object]] = {}
    for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        if block.startswith("# not run by the tests"):  # its imports are, so that no name in it is gone
            block = "".join(line for line in block.splitlines(keepends=True) if line.startswith("from "))
        exec(compile(block, "docs/tutorial/python.md", "exec"), known)
    told = capsys.readouterr().out
    assert told.startswith("True largest displacement") and "prostate_left" in told
    assert "region_1: G = " in told and "case demo_case: rest labels" in told
    assert (demo_case / "sphere.png").stat().st_size > 10_000 and (demo_case / "labels.png").exists()
    assert (demo_case / "ball.png").exists() and (demo_case / "case.png").exists()
