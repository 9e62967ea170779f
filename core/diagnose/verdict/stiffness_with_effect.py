"""The stiffness that is shown beside the plain one: with the posterior of the effect, or of the two, that lead."""

from __future__ import annotations

from dataclasses import replace

from palpate.core.diagnose.refit.stiffness_posterior import with_posterior
from palpate.core.diagnose.verdict.decide import TWO_EFFECTS
from palpate.core.diagnose.verdict.judge import Diagnosis
from palpate.core.diagnose.verdict.verdict import NONE, UNKNOWN
from palpate.core.worker.progress import Progress, silent


def with_stiffness(diagnosis: Diagnosis, progress: Progress = silent) -> Diagnosis:
    """The diagnosis, its leading refit with the posterior of ln G; as it is where no stiffness with an effect is said."""
    if diagnosis.verdict.verdict in (NONE, UNKNOWN):
        return diagnosis
    if diagnosis.verdict.decided_by == TWO_EFFECTS and diagnosis.pairs:
        best, *rest = diagnosis.pairs
        return replace(diagnosis, pairs=[with_posterior(diagnosis.fit, best, progress), *rest])
    if not diagnosis.refits:
        return diagnosis
    best, *rest = diagnosis.refits
    return replace(diagnosis, refits=[with_posterior(diagnosis.fit, best, progress), *rest])
