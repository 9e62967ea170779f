"""A run that is killed goes on, and ends where an undisturbed one ends."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import synthetic_case
from block_case import write_block_case

SHORT = ("--element", "p1p1", "--particles", "8", "--iterations", "40", "--workers", "1")
# Files in the order in which they come: a kill at each.
STAGES = ("identify/problem.npz", "identify/reference.npz", "identify/reduced.npz", "identify/swarm.npz")


def _command(case: Path, *more: str) -> list[str]:
    return [sys.executable, "-m", "palpate.ui.cli", "identify", str(case), *SHORT, *more]


def _killed_when(case: Path, file: str) -> bool:
    """Runs until a file of the case has been written, then SIGKILL; whether it was killed before it had ended."""
    with subprocess.Popen(
        _command(case, "--quiet"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    ) as program:
        while program.poll() is None and not (case / file).exists():
            time.sleep(0.02)
        program.send_signal(signal.SIGKILL)
    return program.returncode == -signal.SIGKILL


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Path:
    problem = synthetic_case.problem((15.0, 45.0), depth=4.5, fine=2)
    return write_block_case(tmp_path_factory.mktemp("killed") / "pair", problem, 4.5).path


@pytest.mark.nightly
def test_killed_at_every_stage_it_ends_as_if_nothing_had_been(pair: Path, tmp_path: Path) -> None:
    calm, killed = tmp_path / "calm", tmp_path / "killed"
    shutil.copytree(pair, calm)
    shutil.copytree(pair, killed)
    for file in STAGES:
        assert _killed_when(killed, file), file
    assert not (killed / "result.json").exists()
    assert not [file for file in killed.rglob("*") if ".tmp" in file.name and file.suffix in (".json", ".npz")]
    results = []
    for case in (calm, killed):
        done = subprocess.run(_command(case, "--json", "--quiet"), capture_output=True, text=True, check=True)
        results.append(json.loads(done.stdout))
    for name, found in results[0]["parameters"].items():
        assert results[1]["parameters"][name]["G_kpa"] == pytest.approx(found["G_kpa"], rel=1e-9)
        assert results[1]["parameters"][name]["ci95_kpa"] == pytest.approx(found["ci95_kpa"], rel=1e-9)
