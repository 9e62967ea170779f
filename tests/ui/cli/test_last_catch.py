"""The rim of the command line: errors that nobody foresaw, streams that are closed, folders that cannot be a case."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from palpate.case.case_folder import check_new_case
from palpate.core.errors import InputError
from palpate.imaging.contours.user_labels import read_label_volume
from palpate.ui.cli import main as cli


def test_an_error_that_nobody_foresaw_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def broken(*_: object) -> int:
        raise RuntimeError("Mustermann^Max\nsecond line")

    monkeypatch.setattr(cli, "_run", broken)
    monkeypatch.delenv("PALPATE_TRACEBACK", raising=False)
    assert cli.main(["doctor", "--json"]) == cli.UNFORESEEN == 5
    told = capfd.readouterr()
    assert told.err.startswith("palpate: RuntimeError in test_last_catch.py, line ") and told.err.count("\n") == 1
    assert "please report it" in told.err and "Mustermann" not in told.err + told.out
    assert json.loads(told.out)["exit_code"] == 5
    monkeypatch.setattr(cli, "_run", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt()))
    assert cli.main(["doctor"]) == 130


@pytest.mark.parametrize("options", [[], ["--json", "--quiet"]])
def test_a_closed_standard_output_is_no_error(options: list[str]) -> None:
    command = [sys.executable, "-m", "palpate.ui.cli", "import", "--nothing", *options]
    closed = subprocess.run(
        ["sh", "-c", 'exec "$@" >&-', "sh", *command], stderr=subprocess.PIPE, text=True, check=False, timeout=120
    )
    assert closed.returncode == 2 and "Traceback" not in closed.stderr and "palpate: " in closed.stderr


def test_a_case_within_a_scan_or_by_a_name_that_is_not_utf_8_is_refused(tmp_path: Path) -> None:
    scan = tmp_path / "scan"
    scan.mkdir()
    for folder in (scan / "case", scan / "a" / "b", tmp_path / "other" / ".." / "scan" / "case"):
        with pytest.raises(InputError, match=r"lies inside the scan .*, whose slices it would join"):
            check_new_case(folder, [scan])
    check_new_case(tmp_path / "scan_case", [scan])
    with pytest.raises(InputError, match=r"caf\\udce9 is a name that is not UTF-8; choose another folder"):
        check_new_case(tmp_path / os.fsdecode(b"caf\xe9"), [scan])


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="a file system whose names are UTF-8")
def test_what_the_libraries_would_end_the_program_for_is_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Names that are not UTF-8: whatever is written, and NRRD files that are read."""
    bad = tmp_path / os.fsdecode(b"caf\xe9")
    bad.mkdir()
    for command in (
        ["export", "case", "--to", "nrrd", str(bad)],
        ["batch", "table.csv", "-o", str(bad)],
        ["sketch", "a.png", "b.png", "-o", str(bad / "film")],
        ["drop", "case", "-o", str(bad / "a.mp4")],
        ["touch", "case", "-o", str(bad)],
        ["simulate", "spec.json", "-o", "case", "--answers", str(bad)],
        ["demo", "-o", str(bad)],
    ):
        assert cli.main(command) == 3
        assert r"caf\udce9" in (told := capfd.readouterr().err) and told.count("is a name that is not UTF-8") == 1
    for name in ("a.nrrd", "a.seg.nrrd"):
        (bad / name).write_bytes(b"NRRD0004\n")
        with pytest.raises(InputError, match="is a name that is not UTF-8; rename it or its folder"):
            read_label_volume(bad / name)
    assert sorted(path.name for path in bad.iterdir()) == ["a.nrrd", "a.seg.nrrd"]
