"""The error of the quick element at the leading effects' own optima, in place of the plain model's.

An organ that gives up volume, is cut free or starts from another shape is another body, and linear cells err on it by something else:
of an organ hidden with Poisson's ratio 0 the correction changes by 0.05 to 0.08 mm rms of 0.24.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection.score_test import Screened
from palpate.core.diagnose.refit.refit import Refit, refit_again
from palpate.core.diagnose.refit.variants import corrected
from palpate.core.residual.element_error import OPTIONS, better_bench, better_residual
from palpate.core.residual.linearised_model import StateModel
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.worker.progress import Progress, silent

# From the quick element's equilibrium the better one is there after a factorisation or two, or fights in vain: 74 s of a sliding
# organ's 180 went into forty.
_FEW = replace(OPTIONS, max_factorisations=8)


def with_own_error(
    fit: PlainFit,
    screened: Sequence[Screened],
    refits: Sequence[Refit],
    rules: DecisionRules,
    progress: Progress = silent,
) -> list[Refit]:
    """The refits (best first), the leading ones corrected by what the better element says at their own optimum, and fitted anew.

    Those on which it finds no equilibrium stay as they are, all of them where it found none for the plain model.
    """
    most, within = rules.own_error_most, rules.own_error_within
    leading = [f for f in refits[:most] if f.log_evidence > refits[0].log_evidence - within]
    if fit.on_own_mesh is None or not leading:
        return list(refits)
    by_id = {s.effect.id: s for s in screened}
    better = [better_bench(b) for b in fit.bench.each]
    out = list(refits)
    for k, found in enumerate(leading):
        assert found.trial.effect is not None
        progress(k / len(leading), f"the better element with {found.trial.effect.id}")
        again = _again(fit, fit.on_own_mesh, by_id[found.trial.effect.id], found, better)
        out[k] = found if again is None else corrected(again, found, by_id[found.trial.effect.id])
    return sorted(out, key=lambda f: -f.log_evidence)


def _again(
    fit: PlainFit, of_plain: FloatArray, screened: Screened, found: Refit, better: Sequence[StateModel]
) -> Refit | None:
    residuals = [better_residual(b, found.trial, p, _FEW) for b, p in zip(better, found.point.each, strict=True)]
    known = [r for r in residuals if r is not None]
    if len(known) < len(residuals):
        return None
    # Other meshes, where there are any, err on the effect as they do on the plain model.
    own = np.concatenate(known) - (found.point.residual - found.correction)
    return refit_again(fit, screened, found, fit.bench.correction + own - of_plain)
