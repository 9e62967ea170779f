"""Many patients: failures are told and passed over, and the same command goes on where it stopped."""

from __future__ import annotations

import csv
import json
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
print(json.dumps({{"result": {{"parameters": {{"prostate_left": region}}, "misfit": {{"rms_mm": 0.4}}}}}}))
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
    path = table(tmp_path, "name,rest,deformed,rest_labels\nA,a,x,\nB,b,x,\nC,c,x,rs.dcm\n")
    patients = batch.read_table(path)
    told: list[tuple[int, str]] = []
    out = tmp_path / "out"
    found = batch.run_all(patients, out, ["--workers", "2"], 2, lambda n, one: told.append((n, one.status)), program)
    assert [one.status for one in found] == ["done", "failed", "done"] and len(told) == 3
    assert found[1].error == f"{tmp_path / 'b'} is not there"
    rows = list(csv.DictReader((out / "results.csv").open()))
    assert [row["name"] for row in rows] == ["A", "B", "C"] and rows[0]["prostate_left_kpa"] == "31.5"
    assert (rows[0]["prostate_left_low_kpa"], rows[0]["misfit_rms_mm"]) == ("20.0", "0.4")
    assert any(f"--rest-labels {tmp_path / 'rs.dcm'}" in line and "--workers 2" in line for line in asked(tmp_path))
    (tmp_path / "b").mkdir()
    again = batch.run_all(patients, out, ["--workers", "2"], 1, lambda n, one: None, program)
    assert [one.status for one in again] == ["done"] * 3 and len(asked(tmp_path)) == 4, "only B once more"
    batch.run_all(patients, out, ["--workers", "1"], 1, lambda n, one: None, program)
    assert len(asked(tmp_path)) == 7, "other options are another run"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name,rest\nA,a\n", "lacks the column deformed; its first line must name name,rest,deformed"),
        ("name,rest,deformed,rest_label\nA,a,b,c\n", "unknown column 'rest_label'; is 'rest_labels' meant"),
        ("name,rest,deformed\nA,a,b,c\n", "line 2 has 4 cells under 3 columns, 'c' under none"),
        ("name,rest,deformed\nA,a,b, May/ct\n", "line 2 has 4 cells under 3 columns, 'May/ct' under none"),
        ("name,rest,deformed,rest\nA,a,b,c\n", "the column 'rest' twice"),
        ("name,rest,deformed\nResults.csv,a,b\n", "line 2: Results.csv is the name of the table of results"),
        ("name,rest,deformed\n", "has no patient"),
        ("name,rest,deformed\nA,a,b\na,c,d\n", "the name 'A' twice"),
        ("name,rest,deformed\n../A,a,b\n", r"line 2: the name '\.\./A' is no folder's name"),
        ("name,rest,deformed\nA,,b\n", "line 2: rest is empty"),
    ],
)
def test_a_table_that_is_wrong_is_told_by_its_line(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        batch.read_table(table(tmp_path, text))


def test_the_command_ends_with_3_and_tells_who_failed(
    tmp_path: Path, program: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a").mkdir()
    path = table(tmp_path, "name,rest,deformed\nA,a,x\nB,b,x\n")
    monkeypatch.setattr(batch.run_one, "__defaults__", (program,))
    monkeypatch.setattr(batch.run_all, "__defaults__", (program, None))
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
