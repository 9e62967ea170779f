"""Every command that README and pages show is understood, and starts through `./run`: in full where that takes seconds, or with --help."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from run_script import run_script

from palpate.ui.cli.main import COMMANDS, parser

TOP = Path(__file__).resolve().parents[3]
README = (TOP / "README.md").read_text(encoding="utf-8")
MEASURED = (TOP / "docs" / "measured.md").read_text(encoding="utf-8")
PAGES = [TOP / "KNOWN_ISSUES.md", TOP / "plugin" / "README.md", *sorted((TOP / "docs").rglob("*.md"))]
# What a reader puts in the place of a word of the README.
MEANT = {"FORM": "nrrd", "COMMAND": "mesh", "...": "KEY3"}


def shown() -> list[list[str]]:
    """The arguments of `palpate` in all code lines and code spans, and in the table of commands."""
    told = re.findall(r"^\./run palpate (.+)$", README, re.MULTILINE)
    told += re.findall(r"`(?:\./run )?palpate ([^`]+)`", README)
    for cell in re.findall(r"^\| (`[^|]+) \|", README, re.MULTILINE):
        spans = re.findall(r"`([^`]+)`", cell)
        told += [span if k == 0 else f"{spans[0].split()[0]} {span}" for k, span in enumerate(spans)]
    return as_given(told)


def shown_by(page: Path) -> list[list[str]]:
    """The arguments of `palpate` in all code lines and code spans of a page; a name alone is no command line."""
    text = page.read_text(encoding="utf-8")
    told = re.findall(r"^(?:    )?(?:\./run )?palpate (.+?)(?:\s{3,}.*)?$", text, re.MULTILINE)
    told += re.findall(r"`(?:\./run )?palpate ([^`]+)`", text)
    return as_given([line for line in told if line not in COMMANDS])


def as_given(told: list[str]) -> list[list[str]]:
    """Arguments of command lines, each once, with what a reader puts in the place of a word."""
    lines = [[MEANT.get(word, word.strip("[]")) for word in shlex.split(line, comments=True)] for line in told]
    return [list(line) for line in dict.fromkeys(map(tuple, lines))]


def test_the_readme_shows_every_command() -> None:
    assert {line[0] for line in shown()} == set(COMMANDS)


@pytest.mark.parametrize("line", shown(), ids=" ".join)
def test_a_command_of_the_readme_is_understood(line: list[str]) -> None:
    if "--help" in line:
        with pytest.raises(SystemExit, match="0"):
            parser(line).parse_args(line)
    else:
        assert parser(line).parse_args(line).command == line[0]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(TOP).as_posix())
def test_the_commands_of_a_page_are_understood(page: Path) -> None:
    for line in shown_by(page):
        test_a_command_of_the_readme_is_understood(line)


def test_pages_show_commands() -> None:
    assert sum(len(shown_by(page)) for page in PAGES) > 60


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_starts_through_run(command: str) -> None:
    done = run_script("palpate", command, "--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"usage: palpate {command} ")


def test_doctor_runs_through_run() -> None:
    done = run_script("palpate", "doctor")
    assert done.returncode == 0, done.stderr
    assert "python: 3." in done.stdout


def test_a_study_with_worker_processes_runs_through_run(tmp_path: Path) -> None:
    done = run_script("palpate", "validate", "robustness", "--scenes", "2", "--workers", "2", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "scenes: 2" in done.stdout


def test_the_demo_starts_through_run() -> None:
    done = run_script("demo", "--help")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("usage: palpate analyze ")


def test_tests_are_found_through_run() -> None:
    (named,) = re.findall(r"`\./run test (\S+/test_laws\.py)`", MEASURED)
    done = run_script("test", "--collect-only", named)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{named}::" in done.stdout


def test_files_of_tests_that_the_measured_figures_name_are_there() -> None:
    named = re.findall(r"tests/[\w/.]+", MEASURED)
    assert len(named) >= 4
    assert [name for name in named if not (TOP / name).exists()] == []
