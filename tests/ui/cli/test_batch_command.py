"""Many patients: failures are told and passed over, and the same command goes on where it stopped."""

from __future__ import annotations

import csv
import json
import os
import sys
from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from types import ModuleType

import pytest

from palpate.core.errors import InputError
from palpate.ui.cli import batch
from palpate.ui.cli import main as cli

# Plays `palpate analyze`: notes that it was asked, fails for a patient without a scan, else answers as the program does.
PROGRAM = """
import json, pathlib, sys
rest, case = pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[5])
with open({log!r}, "a") as log:
    log.write(case.name + " " + " ".join(sys.argv[6:]) + "\\n")
if not rest.is_dir():
    print(json.dumps({{"error": f"{{rest}} is not there"}}))
    sys.exit(3)
case.mkdir(parents=True, exist_ok=True)
(case / "result.json").write_text("x")
region = {{"G_kpa": 31.5, "ci95_kpa": [20.0, 50.0], "at_bound": False}}
print("segment 16 %: rest: bladder", file=sys.stderr)
answer = {{"result": {{"parameters": {{"prostate_left": region}}, "misfit": {{"rms_mm": 0.4}}}}}}
answer["diagnosis"] = {{"verdict": "ambiguous", "candidates": ["sliding"], "gap": {{"p_value": 0.01}}}}
answer["conclusions"] = {{"how_sure": {{"prostate_left": "moderate"}}, "contours": {{"rest": "drawn by hand"}}, "warnings": ["a", "b"]}}
print(json.dumps(answer))
"""


def table(folder: Path, text: str) -> Path:
    path = folder / "patients.csv"
    path.write_text(text)
    return path


@pytest.fixture
def program(tmp_path: Path) -> tuple[str, ...]:
    script = tmp_path / "program.py"
    script.write_text(PROGRAM.format(log=str(tmp_path / "log")))
    return (sys.executable, str(script))


def asked(folder: Path) -> list[str]:
    return (folder / "log").read_text().splitlines()


def test_one_that_fails_takes_no_other_along_and_a_rerun_does_only_it(tmp_path: Path, program: tuple[str, ...]) -> None:
    for name in ("a", "c"):
        (tmp_path / name).mkdir()
    path = table(tmp_path, "name,rest,deformed,rest_labels,registration\nA,a,x,,\nB,b,x,,\nC,c,x,rs.dcm,reg.dcm\n")
    patients = batch.read_table(path)
    told: list[tuple[int, str]] = []
    out = tmp_path / "out"
    found = batch.run_all(patients, out, ["--workers", "2"], 2, lambda n, one: told.append((n, one.status)), program)
    assert [one.status for one in found] == ["done", "failed", "done"] and len(told) == 3
    assert found[1].error == f"{tmp_path / 'b'} is not there"
    rows = list(csv.DictReader((out / "results.csv").open()))
    assert [row["name"] for row in rows] == ["A", "B", "C"] and rows[0]["prostate_left_kpa"] == "31.5"
    assert (rows[0]["prostate_left_low_kpa"], rows[0]["misfit_rms_mm"]) == ("20.0", "0.4")
    assert (rows[0]["verdict"], rows[0]["p_value"], rows[0]["prostate_left_how_sure"]) == (
        "ambiguous",
        "0.01",
        "moderate",
    )
    assert (rows[0]["candidates"], rows[0]["contours_rest"], rows[0]["warnings"]) == (
        "sliding",
        "drawn by hand",
        "a; b",
    )
    assert found[0].values["prostate_left_kpa"] == 31.5 and found[0].values["prostate_left_at_bound"] is False
    assert any(
        f"--rest-labels {tmp_path / 'rs.dcm'} --registration {tmp_path / 'reg.dcm'}" in line and "--workers 2" in line
        for line in asked(tmp_path)
    )
    (tmp_path / "b").mkdir()
    again = batch.run_all(patients, out, ["--workers", "2"], 1, lambda n, one: None, program)
    assert [one.status for one in again] == ["done"] * 3 and len(asked(tmp_path)) == 4, "only B once more"
    filled = [
        {key: value for key, value in one.values.items() if value not in (None, "")} for one in (again[0], found[0])
    ]
    assert filled[0] == filled[1], "numbers are numbers again when they are read back"
    batch.run_all(patients, out, ["--workers", "1"], 1, lambda n, one: None, program)
    assert len(asked(tmp_path)) == 7, "other options are another run"


def test_other_files_or_changed_ones_are_another_run(tmp_path: Path, program: tuple[str, ...]) -> None:
    (tmp_path / "a").mkdir()
    for name in ("rs.dcm", "reg.dcm"):
        (tmp_path / name).write_text("as it was")
    out = tmp_path / "out"

    def runs(column: str, cell: str) -> int:
        path = table(tmp_path, f"name,rest,deformed,{column}\nA,a,x,{cell}\n")
        batch.run_all(batch.read_table(path), out, [], 1, lambda n, one: None, program)
        return len(asked(tmp_path))

    given = [("rest_labels", ""), ("rest_labels", "rs.dcm"), ("deformed_labels", "rs.dcm"), ("registration", "reg.dcm")]
    assert [runs(*one) for one in given] == [1, 2, 3, 4] and runs(*given[-1]) == 4
    later = (out / "A" / "result.json").stat().st_mtime + 5.0
    os.utime(tmp_path / "rs.dcm", (later, later))
    assert runs(*given[-1]) == 4, "a file that is not given"
    os.utime(tmp_path / "reg.dcm", (later, later))
    assert runs(*given[-1]) == 5


def test_nothing_is_written_into_a_scan(tmp_path: Path, program: tuple[str, ...]) -> None:
    (tmp_path / "a").mkdir()
    patients = batch.read_table(table(tmp_path, "name,rest,deformed\nA,x,a\n"))
    with pytest.raises(InputError, match=r"a/out lies inside the scan .*, whose slices it would join"):
        batch.run_all(patients, tmp_path / "a" / "out", [], 1, lambda n, one: None, program)
    assert list((tmp_path / "a").iterdir()) == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name,rest\nA,a\n", "lacks the column deformed; its first line must name name,rest,deformed"),
        ("name,rest,deformed,rest_label\nA,a,b,c\n", "unknown column 'rest_label'; is 'rest_labels' meant"),
        ("name,rest,deformed\nA,a,b,c\n", "line 2 has 4 cells under 3 columns, 'c' under none"),
        ("name,rest,deformed\nA,a,b, May/ct\n", "line 2 has 4 cells under 3 columns, 'May/ct' under none"),
        ("name,rest,deformed,rest\nA,a,b,c\n", "the column 'rest' twice"),
        ("name,rest,deformed\n", "has no patient"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        batch.read_table(table(tmp_path, text))


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("B,c,d", "the name 'B' twice"),
        ("../A,a,b", "line 4: the name '../A' is no folder's name"),
        ("C,,b", "line 4: rest is empty"),
    ],
)
def test_a_row_that_is_wrong_is_told_and_the_others_are_done(
    tmp_path: Path, program: tuple[str, ...], row: str, said: str
) -> None:
    (tmp_path / "a").mkdir()
    path = table(tmp_path, f"name,rest,deformed\nA,a,x\nB,a,x\n{row}\n")
    lines: list[str] = []
    out = tmp_path / "out"
    found = batch.run_all(batch.read_table(path), out, [], 1, lambda n, one: None, program, heard=lines.append)
    assert [one.status for one in found] == ["done", "done", "failed"] and said in found[2].error
    assert [r["status"] for r in csv.DictReader((out / "results.csv").open())] == ["done", "done", "failed"]
    assert lines[:2] == ["A: begun", "A: segment 16 %: rest: bladder"], (
        "what a patient's run is doing is heard as it goes"
    )


def test_the_command_ends_with_3_and_tells_who_failed(
    tmp_path: Path, program: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a").mkdir()
    path = table(tmp_path, "name,rest,deformed\nA,a,x\nB,b,x\n")
    monkeypatch.setattr(batch.run_one, "__defaults__", (program, lambda line: None))
    monkeypatch.setattr(batch.run_all, "__defaults__", (program, None, lambda line: None))
    assert cli.main(["batch", str(path), "-o", str(tmp_path / "out"), "--json", "--quiet"]) == 3
    answer = json.loads(capfd.readouterr().out)
    assert answer["error"].startswith("1 of 2 patients failed") and "B:" in answer["error"]
    assert [row["status"] for row in answer["patients"]] == ["done", "failed"]
    assert cli.main(["batch", str(tmp_path / "none.csv"), "-o", str(tmp_path / "out"), "--quiet"]) == 3


class Client:
    """Stands for distributed.Client: what goes to a worker is pickled, and comes back pickled."""

    def __init__(self, address: str, timeout: float) -> None:
        assert address == "tcp://here:8786"

    def get_executor(self, pure: bool) -> Executor:
        assert not pure
        return ProcessPoolExecutor(1, mp_context=get_context("spawn"))


def test_workers_of_a_dask_cluster_do_the_patients(
    tmp_path: Path, program: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    module = ModuleType("distributed")
    module.Client = Client  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "distributed", module)
    monkeypatch.chdir(tmp_path)
    Path("a").mkdir()
    patients = batch.read_table(table(Path(), "name,rest,deformed\nA,a,x\nB,b,x\n"))
    found = batch.run_all(patients, Path("out"), [], 1, lambda n, one: None, program, "tcp://here:8786")
    assert [one.status for one in found] == ["done", "failed"] and found[0].values["rest"] == str(tmp_path / "a")
    assert (tmp_path / "out" / "A" / "result.json").is_file()
    again = batch.run_all(patients, Path("out"), [], 1, lambda n, one: None, program, "tcp://here:8786")
    assert [one.status for one in again] == ["done", "failed"] and len(asked(tmp_path)) == 3, "A is passed over"


def test_a_cluster_without_dask_is_refused_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    path = table(tmp_path, "name,rest,deformed\nA,a,x\n")
    with pytest.raises(InputError, match="--cluster needs Dask, which is not installed"):
        batch.run_all(batch.read_table(path), tmp_path / "out", [], 1, lambda n, one: None, cluster="tcp://here:8786")
