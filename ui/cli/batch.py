"""Many patients from one table: each the whole way in a process of its own, so that one that fails takes no other with it."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from palpate.core.errors import InputError
from palpate.core.files.atomic import atomic_path
from palpate.core.files.csv_table import Row, read_csv_table
from palpate.core.worker.cluster import study_executor

RESULTS = "results.csv"
DONE, FAILED = "done", "failed"
_NEEDED, _OPTIONAL = ("name", "rest", "deformed"), ("rest_labels", "deformed_labels")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
# Files of a batch beside the folders of its patients.
_TAKEN = (RESULTS,)
_REGIONS = ("prostate_left", "prostate_right")


@dataclass(frozen=True)
class Patient:
    """One row. name : of the case folder. rest, deformed : scans. labels : contours of both, None where there are none."""

    name: str
    rest: Path
    deformed: Path
    labels: tuple[Path | None, Path | None] = (None, None)

    def absolute(self) -> Patient:
        """The same wherever it is done."""
        first, second = (None if path is None else path.absolute() for path in self.labels)
        return replace(self, rest=self.rest.absolute(), deformed=self.deformed.absolute(), labels=(first, second))

    def arguments(self, case: Path) -> list[str]:
        """Of `palpate analyze`."""
        given = [str(self.rest), str(self.deformed), "-o", str(case)]
        for state, path in zip(("rest", "deformed"), self.labels, strict=True):
            given += [] if path is None else [f"--{state}-labels", str(path)]
        return given


@dataclass(frozen=True)
class Outcome:
    """Of one patient. status : DONE or FAILED. error : one line. values : what goes into the table, by column."""

    name: str
    status: str
    error: str
    values: dict[str, str]


def read_table(path: Path) -> list[Patient]:
    """The patients of a CSV table with columns name, rest, deformed and, if wanted, rest_labels, deformed_labels.

    Paths are relative to the table's folder. Raises InputError naming the table, its line and what is wrong with it.
    """
    patients = [_patient(path, row) for row in read_csv_table(path, _NEEDED, _OPTIONAL)]
    if not patients:
        raise InputError(f"{path} has no patient; give one a line below {','.join(_NEEDED)}")
    names = [patient.name.casefold() for patient in patients]
    for patient, name in zip(patients, names, strict=True):
        if names.count(name) > 1:
            raise InputError(f"{path} has the name {patient.name!r} twice; each patient needs a folder of its own")
    return patients


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
    rest, deformed = (path.parent / text[key] for key in ("rest", "deformed"))
    first, second = (path.parent / text[key] if text[key] else None for key in _OPTIONAL)
    return Patient(text["name"], rest, deformed, (first, second))


def run_all(
    patients: Sequence[Patient],
    folder: Path,
    options: Sequence[str],
    at_once: int,
    told: Callable[[int, Outcome], None],
    program: Sequence[str] = (),
    cluster: str | None = None,
) -> list[Outcome]:
    """Analyses every patient into FOLDER/NAME; RESULTS in the folder is written anew after each. Patients that are done in it, with
    the same scans and options, are passed over. told : hears how many are done, and the last one. program : another than this one.
    cluster : address of a Dask scheduler whose workers see the same folders; they do the work, as many at once as there are."""
    folder.mkdir(parents=True, exist_ok=True)
    before = _earlier(folder / RESULTS)
    outcomes = {p.name: before[p.name] for p in patients if _is_same(before.get(p.name), p, folder, options)}
    todo = [p for p in patients if p.name not in outcomes]
    for count, outcome in enumerate(list(outcomes.values()), start=1):
        told(count, outcome)
    one = partial(_one, folder=folder.absolute(), options=tuple(options), program=tuple(program))
    with ThreadPoolExecutor(at_once) if cluster is None else study_executor(at_once, cluster) as pool:
        for outcome in pool.map(one, [p.absolute() for p in todo]):
            outcomes[outcome.name] = outcome
            _write(folder / RESULTS, (outcomes[p.name] for p in patients if p.name in outcomes))
            told(len(outcomes), outcome)
    return [outcomes[p.name] for p in patients]


def _one(patient: Patient, folder: Path, options: Sequence[str], program: Sequence[str]) -> Outcome:
    return run_one(patient, folder / patient.name, options, program)


def run_one(patient: Patient, case: Path, options: Sequence[str], program: Sequence[str] = ()) -> Outcome:
    """One patient, the whole way, with the program of the machine that does it unless another is given."""
    began = time.monotonic()
    command = [
        *(program or (sys.executable, "-P", "-m", "palpate.ui.cli")),
        "analyze",
        *patient.arguments(case),
        "--json",
        "--quiet",
        *options,
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    seconds = f"{time.monotonic() - began:.0f}"
    values = {
        "rest": str(patient.rest),
        "deformed": str(patient.deformed),
        "options": " ".join(options),
        "seconds": seconds,
    }
    try:
        answer = json.loads(done.stdout)
    except ValueError:
        answer = {}
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or [f"ended with status {done.returncode}"])[-1]
        return Outcome(patient.name, FAILED, " ".join(str(answer.get("error") or last).split()), values)
    return Outcome(patient.name, DONE, "", values | _figures(answer["result"]))


def _figures(result: dict[str, dict[str, dict[str, object]]]) -> dict[str, str]:
    """G and its interval of every region, kPa, and the misfit."""
    out: dict[str, str] = {}
    for region in _REGIONS:
        found = result["parameters"].get(region)
        if found is not None:
            interval = found.get("ci95_kpa")
            low, high = interval if isinstance(interval, list) else ("", "")
            out |= {
                f"{region}_kpa": str(found["G_kpa"]),
                f"{region}_low_kpa": str(low),
                f"{region}_high_kpa": str(high),
            }
            out[f"{region}_at_bound"] = str(found["at_bound"]).lower()
    return out | {"misfit_rms_mm": str(result["misfit"]["rms_mm"])}


_COLUMNS = (
    "name", "status", "error", "rest", "deformed", "options", "seconds",
    *(f"{region}_{what}" for region in _REGIONS for what in ("kpa", "low_kpa", "high_kpa", "at_bound")),
    "misfit_rms_mm",
)  # fmt: skip


def _write(path: Path, outcomes: Iterable[Outcome]) -> None:
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        table = csv.DictWriter(stream, _COLUMNS, restval="")
        table.writeheader()
        for one in outcomes:
            table.writerow({"name": one.name, "status": one.status, "error": one.error, **one.values})


def _earlier(path: Path) -> dict[str, Outcome]:
    """What an earlier run wrote; nothing where there was none, or another program's file."""
    if not path.is_file():
        return {}
    with path.open(newline="", encoding="utf-8") as stream:
        rows = [row for row in csv.DictReader(stream) if row.get("name") and row.get("status")]
    return {
        row["name"]: Outcome(
            row["name"], row["status"], row.get("error") or "", {k: row.get(k) or "" for k in _COLUMNS[3:]}
        )
        for row in rows
    }


def _is_same(before: Outcome | None, patient: Patient, folder: Path, options: Sequence[str]) -> bool:
    there = patient.absolute()
    asked = (str(there.rest), str(there.deformed), " ".join(options))
    return (
        before is not None
        and before.status == DONE
        and tuple(before.values.get(key) for key in ("rest", "deformed", "options")) == asked
        and (folder / patient.name / "result.json").is_file()
    )
