"""Tests of one checkout never run on the code of another."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]


def test_a_palpate_of_another_tree_ends_the_tests_with_one_line(tmp_path: Path) -> None:
    other = tmp_path / "palpate" / "core"
    other.mkdir(parents=True)
    for folder in (other.parent, other):
        (folder / "__init__.py").touch()
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        str(TESTS / "core" / "test_statistics.py"),
    ]
    found = subprocess.run(
        command,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        cwd=tmp_path,
        check=False,
    )
    assert found.returncode == 4
    assert f"palpate.core is {other / '__init__.py'}, not of {TESTS.parent}" in found.stdout + found.stderr
    assert "passed" not in found.stdout
