"""`import --surfaces` on the command line: exit codes and one line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import pyvista as pv

from palpate.ui.cli.main import main


def test_wrong_surfaces_get_one_line_and_leave_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good, holed = tmp_path / "good.ply", tmp_path / "holed.ply"
    ball = pv.Sphere(radius=20.0)
    ball.save(good)
    ball.clip(normal=(1.0, 0.0, 0.0), origin=(10.0, 0.0, 0.0)).save(holed)
    command = ["import", "--surfaces", str(good), str(holed), "-o", str(tmp_path / "case"), "--json", "--quiet"]
    assert main(command) == 3
    said = json.loads(capsys.readouterr().out)
    assert said["exit_code"] == 3 and "holed.ply has a hole" in said["error"]
    assert main([*command, "--roi", "prostate=1"]) == 2
    assert "--roi does not go with --surfaces" in json.loads(capsys.readouterr().out)["error"]
    assert not (tmp_path / "case").exists()
