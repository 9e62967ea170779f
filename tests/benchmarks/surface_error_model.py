"""Fit of the errors' model to drawn contours of variants, and how it does on scans that it was not fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypedDict

import numpy as np
from scipy.optimize import minimize
from scipy.stats import spearmanr

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import PalpateError
from palpate.core.statistics import rms
from palpate.segmentation.error_estimate import FLOOR_MM, MOST_MM, Clues, ErrorModel
from palpate.segmentation.methods.surface_mesh import Shell, shell_of_mask
from palpate.segmentation.pelvis import segment_pelvis
from palpate.segmentation.perturbed_runs import perturbed_organs
from palpate.segmentation.surface_error import SHELL_MM, clues_of, expected_dice, spread_points
from palpate.segmentation.working_grid import mask_on
from palpate.validate.segmentation.contoured_scan import ContouredScan
from palpate.validate.segmentation.dice import dice, prompts_of, true_errors

# Errors along one surface go together: it counts as so many independent ones.
_LOOKS = 8.0
# What the weights are drawn to and how strongly, as so many looks: a spread of 1 mm means an error of about 1.5 mm.
_USUAL = np.array([0.3, 0.4, 0.4, 0.3, 0.3, 0.3, 0.0, 0.5])
_PULL = np.array([0.05, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
# What speaks against a surface never makes it surer: only the constant and what points change may be negative. A place without an edge is
# always less sure than one with an edge, by a fifth at least.
_BOUNDS = [(None, None), (0.0, None), (0.0, None), (0.2, None), (0.0, None), (0.0, None), (None, None), (0.0, None)]


@dataclass(frozen=True, eq=False)
class JudgedSurface:
    """One organ as it was found in one way: what speaks for its surface, its true errors (n,) mm, and its Dice."""

    scan: str
    organ: str
    mode: str
    clues: Clues
    errors: FloatArray
    dice: float
    shell: Shell
    chosen: IntArray


class ErrorFigures(TypedDict):
    """What is said of one organ's surfaces beside what is true. said_over_true : quartiles of the ratio of rms errors.

    within : share of places inside 1.96 standard deviations. rank : Spearman's, of the expected and the true Dice. place_rank :
    Spearman's, of the said and the true size of the error over the places of one surface, median.
    """

    organ: str
    surfaces: int
    said_over_true: tuple[float, float, float]
    within: float
    rank: float
    place_rank: float
    weights: list[float]


def judged_surfaces(variant: ContouredScan, modes: Sequence[str], seed: int) -> list[JudgedSurface]:
    """Every organ of a variant that is found, in each mode; nothing where the segmentation ends with an error."""
    out, masks = [], {name: mask for name, mask in variant.masks.items() if not name.startswith("bone")}
    for mode in modes:
        prompts = prompts_of(mode, masks, seed)
        try:
            segmented = segment_pelvis(variant.ct, prompts)
        except PalpateError:
            continue
        scene, runs = segmented.scene, perturbed_organs(segmented.scene, prompts, {}, seed=1)
        for organ, reference in masks.items():
            found = segmented.organs.get(organ)
            if found is None:
                continue
            shell = shell_of_mask(found.mask, scene.grid, SHELL_MM)
            chosen = spread_points(shell, scene.grid)
            clues = clues_of(scene, shell, chosen, found, [run.get(organ) for run in runs])
            errors = true_errors(shell.points[chosen], scene.grid, reference)
            good = dice(np.asarray(found.mask), mask_on(reference, scene.grid))
            out.append(JudgedSurface(variant.name, organ, mode, clues, errors, good, shell, chosen))
    return out


def fitted(surfaces: Sequence[JudgedSurface]) -> ErrorModel:
    """The model that is likeliest, errors being normal, with a weak pull to usual weights."""
    design = np.concatenate([one.clues.design for one in surfaces])
    square = np.concatenate([one.errors**2 for one in surfaces]) + 0.1
    weight = np.concatenate([np.full(len(one.errors), _LOOKS / len(one.errors)) for one in surfaces])

    def unlikely(weights: FloatArray) -> float:
        ln_sd = np.clip(design @ weights, np.log(FLOOR_MM), np.log(MOST_MM))
        pull = 0.5 * float((_PULL * (weights - _USUAL) ** 2).sum())
        return float((weight * (ln_sd + 0.5 * square * np.exp(-2.0 * ln_sd))).sum()) + pull

    found = minimize(unlikely, _USUAL, method="L-BFGS-B", bounds=_BOUNDS, options={"maxiter": 500, "maxfun": 8000})
    return ErrorModel(weights=tuple(float(w) for w in found.x))


def held_out(surfaces: Sequence[JudgedSurface], organ: str) -> ErrorFigures:
    """Figures of one organ, each scan judged by a fit to the others; weights of a fit to all."""
    ours = [one for one in surfaces if one.organ == organ]
    models = {scan: fitted([one for one in ours if one.scan != scan]) for scan in sorted({one.scan for one in ours})}
    return _figures(organ, [(one, models[one.scan]) for one in ours], fitted(ours))


def as_it_is(surfaces: Sequence[JudgedSurface], organ: str, model: ErrorModel) -> ErrorFigures:
    """Figures of one organ by a model that exists, fitted to none of these surfaces."""
    return _figures(organ, [(one, model) for one in surfaces if one.organ == organ], model)


def _figures(organ: str, judged: Sequence[tuple[JudgedSurface, ErrorModel]], of: ErrorModel) -> ErrorFigures:
    """judged : each surface with the model that judges it. of : whose weights are told."""
    rows = []
    for one, model in judged:
        sd = np.clip(model.sd_mm(one.clues), FLOOR_MM, MOST_MM)
        size = np.abs(one.errors)
        by_place = spearmanr(sd, size).statistic if np.ptp(sd) > 0.0 and np.ptp(size) > 0.0 else 0.0
        expected = expected_dice(one.shell, one.chosen, sd)
        inside = float((size < 1.96 * sd).mean())
        rows.append((rms(sd) / max(rms(one.errors), FLOOR_MM), inside, by_place, expected, one.dice))
    ratio, inside_all, place, expected_all, true = (np.array(column) for column in zip(*rows, strict=True))
    low, middle, high = np.quantile(ratio, (0.25, 0.5, 0.75)).round(3).tolist()
    return {
        "organ": organ, "surfaces": len(rows), "said_over_true": (low, middle, high),
        "within": round(float(inside_all.mean()), 3), "rank": round(float(spearmanr(expected_all, true).statistic), 3),
        "place_rank": round(float(np.median(place)), 3), "weights": [round(w, 3) for w in of.weights],
    }  # fmt: skip
