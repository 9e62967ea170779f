"""The stiffness that is shown beside the plain one: with the posterior of the hypothesis that leads."""

from __future__ import annotations

from dataclasses import replace

from palpate.core.diagnose.refit.refit import Refit
from palpate.core.diagnose.refit.stiffness_posterior import with_posterior
from palpate.core.diagnose.verdict.judge import Diagnosis, effect_id
from palpate.core.diagnose.verdict.verdict import NONE, UNKNOWN
from palpate.core.worker.progress import Progress, silent


def leading(diagnosis: Diagnosis) -> Refit | None:
    """The most probable effect, or two together, of those that were refitted; None where none was."""
    probability = diagnosis.verdict.probability
    return max((*diagnosis.refits, *diagnosis.pairs), key=lambda f: probability.get(effect_id(f), 0.0), default=None)


def with_stiffness(diagnosis: Diagnosis, progress: Progress = silent) -> Diagnosis:
    """The diagnosis, its leading refit with the posterior of ln G; as it is where no stiffness with an effect is said."""
    lead = leading(diagnosis)
    if lead is None or diagnosis.verdict.verdict in (NONE, UNKNOWN):
        return diagnosis
    found = with_posterior(diagnosis.fit, lead, progress)
    refits, pairs = ([found if f is lead else f for f in each] for each in (diagnosis.refits, diagnosis.pairs))
    return replace(diagnosis, refits=refits, pairs=pairs)
