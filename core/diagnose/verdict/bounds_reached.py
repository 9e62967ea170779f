"""Regions whose stiffness ended at a bound of what was allowed."""

from __future__ import annotations

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.residual.plain_fit import PlainFit


def bounds_reached(fit: PlainFit, theta: FloatArray, rules: DecisionRules) -> dict[int, str]:
    """By place in theta (t,), ln G: the name of each region that lies within `rules.at_bound` of its bounds, in words."""
    names = fit.model.first.plain.problem.region_names
    return {
        k: names[region].replace("_", " ")
        for k, (region, t, (low, high)) in enumerate(zip(sorted(names), theta, fit.bounds, strict=True))
        if t < low + rules.at_bound or t > high - rules.at_bound
    }
