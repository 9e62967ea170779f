"""Diagnosis of one case: arrays in, judgement out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import logsumexp

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection.gap_test import EffectDirections, looked_at
from palpate.core.diagnose.detection.location import discrepancy_maps
from palpate.core.diagnose.detection.score_test import Screened, screen
from palpate.core.diagnose.effects import Effect, Surroundings
from palpate.core.diagnose.options import DiagnosisOptions
from palpate.core.diagnose.refit.element_error_of_effects import with_own_element_errors
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.diagnose.refit.variants import refit_variants
from palpate.core.diagnose.verdict.judge import Diagnosis, judge
from palpate.core.diagnose.verdict.stiffness_with_effect import with_stiffness
from palpate.core.forward.pressure_fields import pressure_fields
from palpate.core.inference.evidence import mean_of_exponentials
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
    r, J, R = fit.linearisation.residual, fit.linearisation.in_theta, forces.free
    progress(0.46, "score test of every effect")
    geometry, linearisation = fit.model.first.geometry, fit.linearisation.first
    around = Surroundings(
        data.problem, data.gravity, lambda: pressure_fields(geometry, linearisation.scene, linearisation.theta)
    )
    screened = sorted(screen(fit, effects, around), key=lambda s: -s.log_evidence)
    named = {s.effect.id: EffectDirections(s.directions, s.effect.scales, s.effect.bounds) for s in screened}
    looks = looked_at(fit.noise, r, J, R, named, seed, rules=rules)
    test = looks.test()
    refits = [] if test.p_value > rules.clear else _refits(fit, screened, rules, part(progress, 0.6, 0.8))
    if refits:
        refit_evidence = {f.hypothesis.effect.id: f.log_evidence for f in refits if f.hypothesis.effect}
        test = looks.test(refit_evidence)
    refits = with_own_element_errors(fit, screened, refits, rules, part(progress, 0.8, 0.92)) if test.detected else []
    progress(0.92, "prediction of what was left out")
    discrepancy = discrepancy_maps(fit, forces, rules)
    found = judge(fit, test, screened, refits, discrepancy, forces, _unnamed(fit, forces), rules, seed)
    return with_stiffness(found, part(progress, 0.94, 1.0))


def _unnamed(fit: PlainFit, forces: UnknownDiscrepancy) -> float:
    """Log evidence, against the plain model, of a free smooth field of any size, averaged over the noise."""
    r, J, R = fit.linearisation.residual, fit.linearisation.in_theta, forces.free
    none = np.zeros((len(r), len(r)))
    plain = fit.noise.log_likelihood(r, J, none)
    sizes = [size for size in fit.options.gap_sizes if size]
    logs = [logsumexp(fit.noise.log_likelihood(r, J, size**2 * R @ R.T) + fit.noise.log_prior) for size in sizes]
    return mean_of_exponentials(np.array(logs)) - float(logsumexp(plain + fit.noise.log_prior))


def _refits(fit: PlainFit, screened: Sequence[Screened], rules: DecisionRules, progress: Progress) -> list[Refit]:
    """Effects refitted in full, best first."""
    least = screened[0].log_evidence - rules.hopeless if screened else 0.0
    worth = [s for s in screened if s.log_evidence > least or s.tried == 1]
    out = []
    for k, s in enumerate(worth):
        progress(k / len(worth), f"refit with {s.effect.id}")
        refitted = refit_variants(fit, s, rules)
        if refitted is not None:
            out.append(refitted)
    return sorted(out, key=lambda f: -f.log_evidence)
