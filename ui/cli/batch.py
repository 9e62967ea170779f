"""Many patients from one table: each the whole way in a process of its own, so that one that fails takes no other with it."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeGuard

from palpate.core.errors import InputError
from palpate.core.files.atomic import atomic_path
from palpate.core.files.csv_table import Row, read_csv_table
from palpate.core.files.places import check_outside
from palpate.core.worker.cluster import study_executor

RESULTS = "results.csv"
DONE, FAILED = "done", "failed"
_SCANS = ("rest", "deformed")
# Files of a patient beside the scans: an option of `palpate analyze` each.
_OPTIONAL = ("rest_labels", "deformed_labels", "registration")
_NEEDED = ("name", *_SCANS)
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
# Files of a batch beside the folders of its patients.
_TAKEN = (RESULTS,)
_REGIONS = ("prostate_left", "prostate_right")
# Text, a number, whether something is so, or nothing where it is not known.
Value = str | float | bool | None


@dataclass(frozen=True)
class Patient:
    """One row. name : of the case folder. rest, deformed : scans. files : what else is given, by its column.

    problem : why the row cannot be used, in one line; "" where it can.
    """

    name: str
    rest: Path
    deformed: Path
    files: Mapping[str, Path] = field(default_factory=dict)
    problem: str = ""

    def absolute(self) -> Patient:
        """The same wherever it is done."""
        files = {column: path.absolute() for column, path in self.files.items()}
        return replace(self, rest=self.rest.absolute(), deformed=self.deformed.absolute(), files=files)

    def arguments(self, case: Path) -> list[str]:
        """Of `palpate analyze`."""
        given = [str(self.rest), str(self.deformed), "-o", str(case)]
        for column, path in self.files.items():
            given += [f"--{column.replace('_', '-')}", str(path)]
        return given

    def cells(self) -> dict[str, str]:
        """Its paths in the table of results, by column."""
        return {"rest": str(self.rest), "deformed": str(self.deformed), **{k: str(v) for k, v in self.files.items()}}


@dataclass(frozen=True)
class Outcome:
    """Of one patient. status : DONE or FAILED. error : one line. values : what goes into the table, by column."""

    name: str
    status: str
    error: str
    values: dict[str, Value]


def read_table(path: Path) -> list[Patient]:
    """The patients of a CSV table with columns name, rest, deformed and, if wanted, rest_labels, deformed_labels, registration.

    Paths are relative to the table's folder. A row that cannot be used is a patient with a problem. Raises InputError
    naming the table where it has no row, or is no table.
    """
    patients = [
        _or_problem(partial(_patient, path, row), row.cells.get("name", ""))
        for row in read_csv_table(path, _NEEDED, _OPTIONAL)
    ]
    if not patients:
        raise InputError(f"{path} has no patient; give one a line below {','.join(_NEEDED)}")
    return _without_doubles(path, patients)


def _or_problem(read: Callable[[], Patient], name: str) -> Patient:
    try:
        return read()
    except InputError as error:
        return Patient(name, Path(), Path(), problem=str(error))


def _without_doubles(path: Path, patients: Iterable[Patient]) -> list[Patient]:
    """The patients; one whose name an earlier row has already has a problem."""
    seen: set[str] = set()
    found = []
    for patient in patients:
        key = patient.name.casefold()
        if key in seen and not patient.problem:
            problem = f"{path} has the name {patient.name!r} twice; each patient needs a folder of its own"
            patient = replace(patient, problem=problem)
        seen.add(key)
        found.append(patient)
    return found


def _patient(path: Path, row: Row) -> Patient:
    text = {key: row.cells.get(key, "") for key in (*_NEEDED, *_OPTIONAL)}
    if not _NAME.fullmatch(text["name"]):
        raise InputError(
            f"{path}, line {row.line}: the name {text['name']!r} is no folder's name; use letters, digits, . _ -"
        )
    if text["name"].casefold() in _TAKEN:
        raise InputError(f"{path}, line {row.line}: {text['name']} is the name of the table of results; use another")
    empty = [key for key in _NEEDED if not text[key]]
    if empty:
        raise InputError(f"{path}, line {row.line}: {empty[0]} is empty")
    rest, deformed = (path.parent / text[key] for key in _SCANS)
    files = {key: path.parent / text[key] for key in _OPTIONAL if text[key]}
    return Patient(text["name"], rest, deformed, files)


def run_all(
    patients: Sequence[Patient],
    folder: Path,
    options: Sequence[str],
    at_once: int,
    told: Callable[[int, Outcome], None],
    program: Sequence[str] = (),
    cluster: str | None = None,
    heard: Callable[[str], None] = lambda line: None,
) -> list[Outcome]:
    """Analyses every patient into FOLDER/NAME; RESULTS in the folder is written anew after each. Patients that are done in it, with
    the same scans, files and options, all older than the result, are passed over.

    told : hears how many are done, and the last one. program : another than this one.
    cluster : address of a Dask scheduler whose workers see the same folders; they do the work, as many at once as there are.
    heard : hears what each patient's run is doing, a line each; nothing of the runs of a cluster.

    Raises InputError, before anything is written, where the folder lies within a scan."""
    check_outside(folder, (scan for one in patients if not one.problem for scan in (one.rest, one.deformed)))
    folder.mkdir(parents=True, exist_ok=True)
    before = _earlier(folder / RESULTS)
    outcomes: dict[int, Outcome] = {}
    for row, patient in enumerate(patients):
        if patient.problem:
            outcomes[row] = Outcome(patient.name, FAILED, patient.problem, {})
        elif _is_same(known := before.get(patient.name), patient, folder, options):
            outcomes[row] = known
    todo = [row for row in range(len(patients)) if row not in outcomes]
    for count, outcome in enumerate(list(outcomes.values()), start=1):
        told(count, outcome)
    one = partial(_one, folder=folder.absolute(), options=tuple(options), program=tuple(program))
    one = one if cluster is not None else partial(one, heard=heard)
    with ThreadPoolExecutor(at_once) if cluster is None else study_executor(at_once, cluster) as pool:
        for row, outcome in zip(todo, pool.map(one, [patients[row].absolute() for row in todo]), strict=True):
            outcomes[row] = outcome
            _write(folder / RESULTS, (outcomes[k] for k in sorted(outcomes)))
            told(len(outcomes), outcome)
    if not todo:
        _write(folder / RESULTS, (outcomes[k] for k in sorted(outcomes)))
    return [outcomes[row] for row in range(len(patients))]


def _one(
    patient: Patient,
    folder: Path,
    options: Sequence[str],
    program: Sequence[str],
    heard: Callable[[str], None] = lambda line: None,
) -> Outcome:
    return run_one(patient, folder / patient.name, options, program, heard)


def run_one(
    patient: Patient,
    case: Path,
    options: Sequence[str],
    program: Sequence[str] = (),
    heard: Callable[[str], None] = lambda line: None,
) -> Outcome:
    """One patient, the whole way, with the program of the machine that does it unless another is given."""
    began = time.monotonic()
    heard(f"{patient.name}: begun")
    words = program or (sys.executable, "-P", "-m", "palpate.ui.cli")
    command = [*words, "analyze", *patient.arguments(case), "--json", *options]
    status, stdout, stderr = _run(command, lambda line: heard(f"{patient.name}: {line}"))
    values: dict[str, Value] = {
        **patient.cells(),
        "options": " ".join(options),
        "seconds": round(time.monotonic() - began, 1),
    }
    try:
        answer = json.loads(stdout)
    except ValueError:
        answer = {}
    if status != 0:
        last = (stderr or [f"ended with status {status}"])[-1]
        return Outcome(patient.name, FAILED, " ".join(str(answer.get("error") or last).split()), values)
    return Outcome(patient.name, DONE, "", values | figures(answer))


def _run(command: Sequence[str], heard: Callable[[str], None]) -> tuple[int, str, list[str]]:
    """Status, standard output and the lines of standard error of a child process. heard : hears each of these lines."""
    with (
        tempfile.TemporaryFile("w+", encoding="utf-8") as stdout,
        subprocess.Popen(command, stdout=stdout, stderr=subprocess.PIPE, text=True, encoding="utf-8") as child,
    ):
        lines = []
        for line in child.stderr or ():
            if line.strip():
                lines.append(line.strip())
                heard(line.strip())
        status = child.wait()
        stdout.seek(0)
        return status, stdout.read(), lines


def figures(answer: Mapping[str, Any]) -> dict[str, Value]:
    """Columns of one patient from the answer of `palpate analyze --json`: G and its interval of every region, kPa, how sure it
    is, the misfit, the diagnosis, where the contours are from, and warnings."""
    result, told = answer["result"], answer.get("conclusions", {})
    out: dict[str, Value] = {}
    for region in _REGIONS:
        found = result["parameters"].get(region)
        if found is not None:
            low, high = found.get("ci95_kpa") or (None, None)
            out |= {f"{region}_kpa": found["G_kpa"], f"{region}_low_kpa": low, f"{region}_high_kpa": high}
            out |= {f"{region}_at_bound": found["at_bound"], f"{region}_how_sure": told.get("how_sure", {}).get(region)}
    diagnosis = answer.get("diagnosis", {})
    out |= {"misfit_rms_mm": result["misfit"]["rms_mm"], "verdict": diagnosis.get("verdict")}
    out |= {
        "candidates": ", ".join(diagnosis.get("candidates", ())),
        "p_value": diagnosis.get("gap", {}).get("p_value"),
    }
    out |= {f"contours_{state}": told.get("contours", {}).get(state) for state in ("rest", "deformed")}
    return out | {"warnings": "; ".join(told.get("warnings", ()))}


_OF_REGION = ("kpa", "low_kpa", "high_kpa", "at_bound", "how_sure")
_COLUMNS = (
    "name", "status", "error", *_SCANS, *_OPTIONAL, "options", "seconds",
    *(f"{region}_{what}" for region in _REGIONS for what in _OF_REGION),
    "misfit_rms_mm", "verdict", "candidates", "p_value", "contours_rest", "contours_deformed", "warnings",
)  # fmt: skip
_NUMBERS = ("seconds", "misfit_rms_mm", "p_value", *(f"{r}_{what}" for r in _REGIONS for what in _OF_REGION[:3]))
_YES_OR_NO = tuple(f"{region}_at_bound" for region in _REGIONS)


def _write(path: Path, outcomes: Iterable[Outcome]) -> None:
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        table = csv.DictWriter(stream, _COLUMNS, restval="")
        table.writeheader()
        for one in outcomes:
            cells = {key: str(v).lower() if isinstance(v, bool) else v for key, v in one.values.items()}
            table.writerow({"name": one.name, "status": one.status, "error": one.error, **cells})


def _earlier(path: Path) -> dict[str, Outcome]:
    """What an earlier run wrote; nothing where there was none, or another program's file."""
    if not path.is_file():
        return {}
    with path.open(newline="", encoding="utf-8") as stream:
        rows = [row for row in csv.DictReader(stream) if row.get("name") and row.get("status")]
    return {
        row["name"]: Outcome(
            row["name"], row["status"], row.get("error") or "", {k: _value(k, row.get(k) or "") for k in _COLUMNS[3:]}
        )
        for row in rows
    }


def _value(column: str, text: str) -> Value:
    """A cell of RESULTS as it was before it was written."""
    if column in _YES_OR_NO:
        return None if not text else text == "true"
    if column not in _NUMBERS:
        return text
    try:
        return float(text)
    except ValueError:
        return None


def _is_same(before: Outcome | None, patient: Patient, folder: Path, options: Sequence[str]) -> TypeGuard[Outcome]:
    asked = {**dict.fromkeys(_OPTIONAL, ""), **patient.absolute().cells(), "options": " ".join(options)}
    return (
        before is not None
        and before.status == DONE
        and {key: before.values.get(key) or "" for key in asked} == asked
        and _is_newer(folder / patient.name / "result.json", patient)
    )


def _is_newer(result: Path, patient: Patient) -> bool:
    """Whether a result is there that was written after every file that it was made from."""
    if not result.is_file():
        return False
    given = (patient.rest, patient.deformed, *patient.files.values())
    files = (file for path in given for file in (path, *(path.rglob("*") if path.is_dir() else ())))
    return all(file.stat().st_mtime <= result.stat().st_mtime for file in files if file.exists())
