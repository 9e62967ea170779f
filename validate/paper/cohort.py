"""The paper's Fig 13 and its statistics: does the stiffness that is found go with the stage of the cancer?

On a virtual cohort, whose stage sets the size and the stiffness of a tumour, one anatomy for all; or on a table of real cases.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NotRequired, TypedDict, final

import numpy as np
from scipy import stats

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.files.csv_table import read_csv_table
from palpate.core.worker.cluster import study_executor
from palpate.core.worker.executors import one_thread
from palpate.core.worker.progress import Progress, silent
from palpate.validate.paper.tumour_data import DATA_DIVISIONS, DATA_ELEMENT, TumourData, tumour_data
from palpate.validate.paper.tumour_fit import Found, TumourFit
from palpate.validate.paper.tumour_scene import Divisions


class Correlation(TypedDict):
    """Pearson's and Spearman's coefficients of stiffness with stage, and their p-values (two-sided)."""

    pearson: float
    pearson_p: float
    spearman: float
    spearman_p: float


class PaperCorrelation(Correlation):
    """The same as the paper prints them, of so many patients."""

    patients: int


@final
class VirtualPatient(TypedDict):
    """Stage, tumour, mu (2,) kPa that both halves have and that are found, their 95 % intervals (2, 2), and means of both halves."""

    stage: float
    share: float
    tumour_mu_kpa: float
    effective_mu_kpa: FloatArray
    effective_mean_mu_kpa: float
    clean_mean_mu_kpa: float
    noisy_mu_kpa: FloatArray
    noisy_ci95_kpa: FloatArray
    noisy_mean_mu_kpa: float


@final
class RealPatient(TypedDict):
    """A row of a table."""

    stage: float
    mu_kpa: float


class CohortTable(TypedDict):
    """Patients, virtual or of a table, and the correlation of each kind of value; of virtual ones also how they were made."""

    study: str
    patients: str
    noise_sd_mm: NotRequired[float]
    cells: NotRequired[int]
    element: NotRequired[str]
    data_cells: NotRequired[int]
    data_element: NotRequired[str]
    rows: list[VirtualPatient] | list[RealPatient]
    statistics: dict[str, Correlation]
    paper: PaperCorrelation


PAPER: PaperCorrelation = {
    "patients": 10,
    "pearson": 0.8233,
    "pearson_p": 0.0034,
    "spearman": 0.8304,
    "spearman_p": 0.0029,
}
# Of the virtual cohort, by stage T1 to T4: the tumour's share of its half and its mu over the normal tissue's. Assumed: no
# measurement says how stage and stiffness go together; both scatter from patient to patient by `SCATTER` of ln.
SHARE_BY_STAGE = (0.10, 0.30, 0.55, 0.80)
CONTRAST_BY_STAGE = (1.5, 2.5, 4.0, 6.0)
SCATTER = 0.25
NORMAL_MU = 15.0
_COLUMNS = ("stage", "mu_kpa")
# A case may have a name in the table, which nothing is made of.
_NAMES = ("case",)


@dataclass(frozen=True)
class CohortOptions:
    """patients : virtual ones, stages taken in turn. sd_mm : of their contours. identify, data : meshes.

    workers : processes that make patients, cluster : address of a Dask scheduler instead; neither changes an outcome.
    """

    patients: int = 10
    sd_mm: float = 0.4
    identify: Divisions = field(default_factory=Divisions)
    data: Divisions = DATA_DIVISIONS
    element: str = "p2p1"
    seed: int = 1
    workers: int = 1
    cluster: str | None = None

    @classmethod
    def quick(cls, seed: int = 1) -> CohortOptions:
        """Coarse meshes."""
        return cls(10, 0.4, Divisions(2, 1, 1), Divisions(4, 1, 1), seed=seed)


def cohort(options: CohortOptions | None = None, progress: Progress = silent) -> CohortTable:
    """The virtual cohort: stage, what each organ has and what is found of it, and their correlation with and without noise."""
    o = options or CohortOptions()
    rng = np.random.default_rng(o.seed)
    stages = [1 + k % 4 for k in range(o.patients)]
    with one_thread():
        people = []
        recipes = [(*_recipe(stage, rng), o.data) for stage in stages]
        with study_executor(o.workers, o.cluster) as executor:
            for k, data in enumerate(executor.map(_patient, recipes)):
                progress(0.5 * (k + 1) / len(stages), f"patient {k + 1} of {len(stages)}")
                people.append(data)
        fit = TumourFit(
            people[0].organ.rest, o.identify, o.element, o.data, progress=lambda f, m: progress(0.5 + 0.4 * f, m)
        )
        fit.set_noise(o.sd_mm)
        errors = fit.draw(rng, len(people))
        rows = []
        for stage, data, error in zip(stages, people, errors, strict=True):
            rows.append(_row(stage, data, fit.identify(data), fit.identify(data, error)))
    progress(1.0, "done")
    values = {
        "truth": [row["effective_mean_mu_kpa"] for row in rows],
        "clean": [row["clean_mean_mu_kpa"] for row in rows],
        "noisy": [row["noisy_mean_mu_kpa"] for row in rows],
    }
    return {
        "study": "cohort",
        "patients": "virtual: stage sets the tumour's size and stiffness, one anatomy for all",
        "noise_sd_mm": o.sd_mm,
        "cells": o.identify.cells,
        "element": o.element,
        "data_cells": o.data.cells,
        "data_element": DATA_ELEMENT,
        "rows": rows,
        "statistics": {key: correlation(stages, v) for key, v in values.items()},
        "paper": PAPER,
    }


def cohort_of_table(path: Path) -> CohortTable:
    """The statistics of real cases: a CSV with columns `stage` (T1 to T4, or a number) and `mu_kpa`, and `case` for names, one row a case.

    Raises InputError when the file or a row of it cannot be read or holds more, or there are fewer than 3 cases or one stage only.
    """
    rows = [_read(row.cells, path, row.line) for row in read_csv_table(path, _COLUMNS, _NAMES)]
    if len(rows) < 3 or len({row["stage"] for row in rows}) < 2:
        raise InputError(f"{path} has {len(rows)} cases; 3 or more of at least two stages are needed")
    stages, values = [row["stage"] for row in rows], [row["mu_kpa"] for row in rows]
    return {"study": "cohort", "patients": "read from a table", "rows": rows,
            "statistics": {"table": correlation(stages, values)}, "paper": PAPER}  # fmt: skip


def correlation(stages: Sequence[float], values: Sequence[float]) -> Correlation:
    """Of values with stage; see `Correlation`."""
    linear, ranks = stats.pearsonr(stages, values), stats.spearmanr(stages, values)
    return {
        "pearson": float(linear.statistic),
        "pearson_p": float(linear.pvalue),
        "spearman": float(ranks.statistic),
        "spearman_p": float(ranks.pvalue),
    }


def _recipe(stage: int, rng: np.random.Generator) -> tuple[float, float, float]:
    """Share and mu of the tumour, mu of the normal tissue, kPa."""
    scatter = np.exp(SCATTER * rng.standard_normal(3))
    normal = NORMAL_MU * scatter[0]
    share = float(np.clip(SHARE_BY_STAGE[stage - 1] * scatter[1], 0.02, 0.9))
    return share, normal * max(CONTRAST_BY_STAGE[stage - 1] * scatter[2], 1.05), normal


def _patient(recipe: tuple[float, float, float, Divisions]) -> TumourData:
    share, tumour_mu, normal_mu, data = recipe
    return tumour_data(share, tumour_mu, data, normal_mu)


def _row(stage: int, data: TumourData, clean: Found, noisy: Found) -> VirtualPatient:
    return {
        "stage": stage,
        "share": data.share,
        "tumour_mu_kpa": data.tumour_mu,
        "effective_mu_kpa": data.effective_mu,
        "effective_mean_mu_kpa": float(data.effective_mu.mean()),
        "clean_mean_mu_kpa": float(clean.mu.mean()),
        "noisy_mu_kpa": noisy.mu,
        "noisy_ci95_kpa": noisy.interval,
        "noisy_mean_mu_kpa": float(noisy.mu.mean()),
    }


def _read(row: Mapping[str, str], path: Path, line: int) -> RealPatient:
    text = row["stage"].upper().removeprefix("T")
    try:
        stage, mu = float(text), float(row["mu_kpa"])
    except ValueError as error:
        raise InputError(
            f"{path}, line {line}: stage {row['stage']!r} and mu_kpa {row['mu_kpa']!r} are not like T2 and 41.5; correct them"
        ) from error
    if not (0.0 <= stage <= 4.0 and 0.0 < mu < 1e5):
        raise InputError(f"{path}, line {line}: stage {stage:g} or mu_kpa {mu:g} is out of range; correct it there")
    return {"stage": stage, "mu_kpa": mu}
