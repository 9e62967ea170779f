"""Simulation-based calibration of what the program says of ln G: `palpate validate calibration`.

ln G is drawn from the prior, a pair simulated, sealed and analysed; ranks of the truth among draws of the posterior are uniform when,
and only when, posterior and prior fit what was simulated.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np

from palpate.core.errors import InputError
from palpate.core.worker.progress import Progress, part, silent
from palpate.validate.calibration.patients import check, make_patient, name_of
from palpate.validate.calibration.posterior import Marginal, posteriors_of
from palpate.validate.calibration.ranks import by_region, calibration
from palpate.validate.calibration.records import CalibrationOptions, CalibrationTable, CalibrationTruth
from palpate.validate.sealed import Kind, SealedStudy, make_each, run_program

Ranked = tuple[Marginal, float, int]
Make = Callable[[CalibrationOptions, int, Path], bool]


@dataclass(frozen=True)
class Estimator:
    """What is calibrated. result : file in the case that it writes. analyse : writes it, given the case's path and seconds. posteriors :
    reads it, given the case's path and `result`.
    """

    result: str
    analyse: Callable[[Path, float], None]
    posteriors: Callable[[Path, str], dict[str, Marginal]] = posteriors_of


def _identified(case: Path, timeout_s: float) -> None:
    _commanded(case, timeout_s, "identify", "--method", "gauss-newton", "--no-map")


def _diagnosed(case: Path, timeout_s: float) -> None:
    _commanded(case, timeout_s, "diagnose")


def _commanded(case: Path, timeout_s: float, command: str, *options: str) -> None:
    """The program's command on a case, in a process that knows the case's path alone."""
    case = case.resolve()
    run_program([command, str(case), *options], case, "analysis.log", timeout_s)


IDENTIFY, DIAGNOSE = Estimator("result.json", _identified), Estimator("diagnosis.json", _diagnosed)


def run(
    folder: Path,
    options: CalibrationOptions | None = None,
    progress: Progress = silent,
    estimator: Estimator | None = None,
    make: Make = make_patient,
) -> CalibrationTable:
    """Make patients in folder/cases, answers in folder/answers, the ledger in folder/ledger.json; return the figures.

    estimator : `identify`, or with an effect `diagnose`, unless given. make : see `make_patient`. A run that was stopped goes on. Raises
    InputError for unknown simulators and effects, and when the folder holds another study.
    """
    options = options or CalibrationOptions()
    check(options)
    estimator = estimator or (IDENTIFY if options.effect is None else DIAGNOSE)
    sealed = SealedStudy(folder, estimator.result)
    sealed.begin(_kind(options), _kind(CalibrationOptions()), _flags)
    make_each(partial(_made, make, options, folder), range(options.cases), options.workers, part(progress, 0.0, 0.5))
    names = sealed.made([name_of(k) for k in range(options.cases)])
    if not names:
        raise InputError(f"no patient of {folder} could be simulated; give other --bounds or another --seed")
    sealed.seal(names)
    sealed.analyse(names, partial(_analysed, estimator, options.timeout_s), options.workers, part(progress, 0.5, 0.98))
    sealed.check_unchanged()
    return _table(sealed, options, estimator, names)


def _analysed(estimator: Estimator, timeout_s: float, case: Path) -> None:
    estimator.analyse(case, timeout_s)


def _made(make: Make, options: CalibrationOptions, folder: Path, number: int) -> None:
    make(options, number, folder)


def _table(
    sealed: SealedStudy, options: CalibrationOptions, estimator: Estimator, names: Sequence[str]
) -> CalibrationTable:
    ranked = [found for name in names if (found := _ranked(sealed, options, estimator, name))]
    rng = np.random.default_rng([options.seed, 84])
    one = [list(found.values())[rng.integers(len(found))] for found in ranked]
    regions = sorted({region for found in ranked for region in found})
    return {
        "study": "calibration",
        "simulator": options.simulator,
        "effect": options.effect,
        "seed": options.seed,
        "bounds_kpa": options.bounds_kpa,
        "failed": len(names) - len(ranked),
        "short": options.cases - len(names),
        "one_region": calibration(one) if one else None,
        "by_region": {r: calibration([found[r] for found in ranked if r in found]) for r in regions},
        "ledger": str(sealed.ledger_path),
    }


def _ranked(
    sealed: SealedStudy, options: CalibrationOptions, estimator: Estimator, name: str
) -> dict[str, Ranked] | None:
    """Posterior, truth and rank by region; None where there is no posterior."""
    case = sealed.cases / name
    if not (case / estimator.result).exists():
        return None
    truth: CalibrationTruth = json.loads((sealed.answers / f"{name}.json").read_text(encoding="utf-8"))
    rng = np.random.default_rng([options.seed, int(name.rsplit("_", 1)[1]), 83])
    truths = {region: float(np.log(G)) for region, G in truth["true_G_kpa"].items()}
    return by_region(estimator.posteriors(case, estimator.result), truths, rng) or None


def _kind(options: CalibrationOptions) -> Kind:
    held = asdict(options)
    return {name: held[name] for name in ("simulator", "effect", "seed")} | {"bounds_kpa": list(options.bounds_kpa)}


def _flags(kind: Kind) -> str:
    bounds = kind["bounds_kpa"]
    assert isinstance(bounds, list)
    told = f"--simulator {kind['simulator']} --seed {kind['seed']} --bounds {bounds[0]:g} {bounds[1]:g}"
    return told + (f" --effect {kind['effect']}" if kind["effect"] is not None else "")


def calibration_text(found: CalibrationTable) -> str:
    """The table for a person."""
    lines = [
        f"simulator {found['simulator']}, {found['effect'] or 'nothing'} hidden; {found['failed']} without an answer, "
        f"{found['short']} could not be simulated"
    ]
    rows = (
        dict(found["by_region"])
        if found["one_region"] is None
        else {"one a patient": found["one_region"]} | found["by_region"]
    )
    for name, row in rows.items():
        p = "too few" if row["chi_square_p"] is None else f"{row['chi_square_p']:.3g}"
        holds = ", ".join(
            f"{100 * i['level']:.0f} %: {100 * i['holds']:.1f} ({100 * i['low']:.1f} to {100 * i['high']:.1f})"
            for i in row["intervals"]
        )
        lines.append(
            f"{name}: {row['cases']} cases, ranks {row['ranks']}, chi-square p {p}; intervals hold {holds}; "
            f"z mean {row['z_mean']:+.2f} (se {row['z_mean_error']:.2f}), rms {row['z_rms']:.2f} (se {row['z_rms_error']:.2f}); "
            f"ln G off by {row['mean_error_ln_G']:+.2f} in the mean, sd {row['sd_ln_G']:.2f}"
        )
    return "\n".join(lines)
