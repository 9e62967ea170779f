"""A body's diagnosis in the form of diagnosis.json, piece by piece."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.bench_bodies.fit import BodyFit
from palpate.core.diagnose.bench_bodies.judge import LEVEL
from palpate.core.diagnose.bench_bodies.rivals import Rival, marker_rms
from palpate.core.diagnose.verdict.verdict import AMBIGUOUS, NONE


def by_state(fit: BodyFit) -> list[FloatArray]:
    """Residuals (k, 3) mm of every state's markers."""
    ends = np.cumsum([3 * len(fit.model.stage.problem.states[k].rest) for k in fit.which])
    return [r.reshape(-1, 3) for r in np.split(fit.residual, ends[:-1])]


def gap(base: BodyFit, p: float) -> dict[str, Any]:
    """The "gap" of diagnosis.json; p : of the markers under their noise alone."""
    distance = np.linalg.norm(np.vstack(by_state(base)), axis=1)
    noise = [3.0 * base.model.stage.problem.states[k].sd_mm ** 2 for k in base.which]
    return {
        "rms_mm": float(np.sqrt((distance**2).mean())),
        "p95_mm": float(np.quantile(distance, 0.95)),
        "noise_floor_mm": float(np.sqrt(np.mean(noise))),
        "detected": p < LEVEL,
        "p_value": p,
    }


def regions(base: BodyFit) -> list[dict[str, Any]]:
    """Markers by state."""
    total = max(float((base.residual**2).sum()), 1e-30)
    names = [s.name for s in base.model.stage.problem.states]
    return [
        {"name": n, "side": "all", "rms_mm": marker_rms(r.ravel()), "share": float((r**2).sum()) / total}
        for n, r in zip(names, by_state(base), strict=True)
    ]


def stiffness(fit: BodyFit) -> dict[str, dict[str, float]]:
    """G and its standard deviation, kPa."""
    G, sd = float(np.exp(fit.x[0])), float(np.sqrt(fit.covariance[0, 0]))
    return {"body": {"G_kpa": G, "sd_kpa": G * float(np.sinh(sd)), "sd_ln_G": sd}}


def row(base: BodyFit, f: Rival, probability: float) -> dict[str, Any]:
    """One row of "ranking"."""
    before, after = (float(np.sqrt(np.square(c).mean())) for c in f.left_out.T)
    names = zip(f.effect.parameters, f.fit.x[-len(f.effect.parameters) :], strict=True)
    sd = np.sqrt(np.diag(f.fit.covariance))[-len(f.effect.parameters) :]
    return {
        "effect": f.effect.id,
        "probability": probability,
        "residual_share": float((f.fit.residual**2).sum() / max((base.residual**2).sum(), 1e-30)),
        "cv_gain_mm": before - after if np.isfinite(before) else 0.0,
        "p_value": f.p_value,
        "parameters": {
            p.name: {"value": p.physical(float(v * p.scale)), "sd": float(s * p.scale), "unit": p.unit}
            for (p, v), s in zip(names, sd, strict=True)
        },
        "variant": f.fit.model.added[-1].variants[0].name,
        "log_evidence": f.log_evidence,
        "refitted": True,
    }


def shrinkage(best: Rival) -> dict[str, Any] | None:
    """On states left out; None where there is but one."""
    if not np.isfinite(best.left_out).all():
        return None
    before, after = (float(np.sqrt(np.square(c).mean())) for c in best.left_out.T)
    fraction = 1.0 - after / max(before, 1e-30)
    return {
        "held_out_rms_before_mm": before,
        "held_out_rms_after_mm": after,
        "fraction": fraction,
        "noise_corrected_fraction": fraction,
        "ci95": [float(x) for x in np.quantile(1.0 - best.left_out[:, 1] / best.left_out[:, 0], [0.0, 1.0])],
        "ceiling_fraction": 1.0,
        "placebo_fraction": 0.0,
        "effect": best.effect.id,
    }


def states(base: BodyFit, best: Rival | None) -> list[dict[str, Any]]:
    """Every state's misfit, mm, before and after, fitted and predicted from the others."""
    out = []
    for k, (state, r) in enumerate(zip(base.model.stage.problem.states, by_state(base), strict=True)):
        row: dict[str, Any] = {"name": state.name, "rms_before_mm": marker_rms(r.ravel())}
        if best is not None:
            row["rms_after_mm"] = marker_rms(by_state(best.fit)[k].ravel())
            held_out = [float(x) if np.isfinite(x) else None for x in best.left_out[k]]
            row["held_out_before_mm"], row["held_out_after_mm"] = held_out
        out.append(row)
    return out


def remainder(named: BodyFit, cause: Rival | None) -> dict[str, Any]:
    """What is left in each state, mm, and a second cause where one passes."""
    names = [s.name for s in named.model.stage.problem.states]
    left = {n: marker_rms(r.ravel()) for n, r in zip(names, by_state(named), strict=True)}
    return {"rms_mm": left, "cause": None if cause is None else cause.effect.id}


def next_state(base: BodyFit, best: Rival) -> str:
    """The further load under which the rivals' markers differ most, and by how much."""
    problem = base.model.stage.problem
    told = []
    for factor, words in ((0.0, "no load"), (2.0, "twice the load")):
        loads = tuple(
            replace(load, force_n=(factor * load.force_n[0], factor * load.force_n[1], factor * load.force_n[2]))
            for load in problem.states[-1].loads
        )
        asked = replace(problem.states[-1], name=words, loads=loads)
        moved = []
        for fit in (base, best.fit):
            at = fit.model.stage.solve(fit.model.composition(fit.x, len(problem.states) - 1), fit.x[:1], asked)
            moved.append(fit.model.stage.markers(at.u, asked))
        told.append((marker_rms((moved[0] - moved[1]).ravel()), words))
    (first, one), (second, other) = sorted(told, reverse=True)
    return (
        f"a further load: with {one} the models' markers differ by {first:.1f} mm (with {other} by {second:.1f} mm), "
        f"which tells {best.effect.id.replace('_', ' ')} from another stiffness"
    )


def words(base: BodyFit, verdict: str, named: Rival | None) -> str:
    """A sentence."""
    rms = float(np.sqrt((np.linalg.norm(np.vstack(by_state(base)), axis=1) ** 2).mean()))
    start = f"The plain model misses the markers by {rms:.2f} mm"
    if verdict == NONE:
        return f"{start}, no more than their own error."
    if named is None:
        return (
            f"{start}; these states cannot tell why."
            if verdict == AMBIGUOUS
            else f"{start}; nothing in the library explains it."
        )
    return f"{start}, because {named.effect.words}; with it the states are missed by {marker_rms(named.fit.residual):.2f} mm."
