"""Diagnosis of one case: arrays in, judgement out."""

from __future__ import annotations

from collections.abc import Mapping

from palpate.core.diagnose.comparison import compared
from palpate.core.diagnose.detection.gap_test import free_field
from palpate.core.diagnose.detection.location import discrepancy_maps
from palpate.core.diagnose.detection.score_test import screen
from palpate.core.diagnose.effects import Effect, Surroundings
from palpate.core.diagnose.options import DiagnosisOptions
from palpate.core.diagnose.refit.element_error_of_effects import with_own_element_errors
from palpate.core.diagnose.verdict.judge import Diagnosis, judge
from palpate.core.diagnose.verdict.stiffness_with_effect import with_stiffness
from palpate.core.forward.pressure_fields import pressure_fields
from palpate.core.residual.case_data import CaseData
from palpate.core.residual.plain_fit import PlainFit, fit_plain
from palpate.core.residual.unknown_field import UnknownDiscrepancy
from palpate.core.worker.progress import Progress, part, silent

# Share of the work after which the plain model is fitted.
FITTED = 0.45


def diagnose(
    data: CaseData,
    effects: Mapping[str, Effect],
    progress: Progress = silent,
    seed: int = 1,
    options: DiagnosisOptions | None = None,
    fit: PlainFit | None = None,
) -> Diagnosis:
    """Diagnose a case, with the program's own numbers where no options are given.

    fit : the case's plain fit with these numbers, where it is known.

    Raises InputError for a problem that cannot be posed, ConvergenceError when nothing can be solved.
    """
    options = options or DiagnosisOptions()
    rules = options.decision_rules
    if fit is None:
        fit_progress = part(progress, 0.0, FITTED)
        fit = fit_plain(data.pairs, data.remeshed, fit_progress, options.noise_model, options.wall_motion)
    forces = UnknownDiscrepancy.around(fit.linearisation, fit.model.data_vectors, fit.options)
    progress(0.46, "score test of every effect")
    found = compared(
        fit,
        screen(fit, effects, _surroundings(data, fit)),
        free_field(forces.free, fit.options.gap_sizes),
        rules,
        seed,
        part(progress, 0.48, 0.92),
        lambda screened, refits, progress: with_own_element_errors(fit, screened, refits, rules, progress),
    )
    progress(0.92, "prediction of what was left out")
    discrepancy = discrepancy_maps(fit, forces, rules)
    return with_stiffness(judge(fit, found, discrepancy, forces, rules, seed), part(progress, 0.94, 1.0))


def _surroundings(data: CaseData, fit: PlainFit) -> Surroundings:
    geometry, at = fit.model.first.geometry, fit.linearisation.first
    return Surroundings(data.problem, data.gravity, lambda: pressure_fields(geometry, at.scene, at.theta))
