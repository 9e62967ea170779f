"""Every command that the README shows exists, and starts through `./run`: in full where that takes seconds, or with --help."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from run_script import run_script

from palpate.ui.cli.main import COMMANDS, parser

TOP = Path(__file__).resolve().parents[3]
README = (TOP / "README.md").read_text(encoding="utf-8")
# What a reader puts in the place of a word of the README.
MEANT = {"FORM": "nrrd", "COMMAND": "mesh", "...": "KEY3"}


def shown() -> list[list[str]]:
    """The arguments of `palpate` in all code lines and code spans, and in the table of commands."""
    told = re.findall(r"^\./run palpate (.+)$", README, re.MULTILINE)
    told += re.findall(r"`(?:\./run )?palpate ([^`]+)`", README)
    for cell in re.findall(r"^\| (`[^|]+) \|", README, re.MULTILINE):
        spans = re.findall(r"`([^`]+)`", cell)
        told += [span if k == 0 else f"{spans[0].split()[0]} {span}" for k, span in enumerate(spans)]
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
    (named,) = re.findall(r"`\./run test (\S+/test_laws\.py)`", README)
    done = run_script("test", "--collect-only", named)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{named}::" in done.stdout


def test_files_of_tests_that_the_readme_names_are_there() -> None:
    named = re.findall(r"tests/[\w/.]+", README)
    assert len(named) >= 4
    assert [name for name in named if not (TOP / name).exists()] == []
