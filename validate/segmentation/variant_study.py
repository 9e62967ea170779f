"""Segmentation of scans as other scanners, protocols and patients would show them: Dice by organ and way, the worst tenth too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TypedDict, final

import numpy as np

from palpate.core.errors import PalpateError
from palpate.core.worker.progress import Progress, silent
from palpate.validate.segmentation.contoured_scan import ContouredScan
from palpate.validate.segmentation.dice import MODES, dice_table
from palpate.validate.segmentation.study import rank_correlation
from palpate.validate.segmentation.variants import Recipe, drawn_recipe, variant_of

# Share of the variants that the lowest quoted figure leaves below it.
WORST = 0.1


class VariantRow(TypedDict):
    """One organ of one variant, found in one way. dice : 0 where it was not found. failed : why, where segmentation ended.
    said_mm, true_mm : see `DiceRow`; None where it was not found."""

    variant: int
    scan: str
    organ: str
    mode: str
    dice: float
    volume_cc: float
    reference_cc: float
    confidence: float | None
    said_mm: float | None
    true_mm: float | None
    failed: str | None


class VariantSummary(TypedDict):
    """Dice of one organ and way over all variants. said_over_true : median ratio of the surface's error as estimated and
    against the drawing; None where the organ was never found."""

    organ: str
    mode: str
    count: int
    median: float
    worst_tenth: float
    not_found: int
    said_over_true: float | None


@final
class VariantTable(TypedDict):
    """Rows, recipes, figures by organ and way, and rank correlation of confidence and Dice by organ."""

    rows: list[VariantRow]
    recipes: list[dict[str, float | bool]]
    summary: list[VariantSummary]
    worse_than_auto: int
    confidence_rank_correlation: dict[str, float]


def variant_study(
    scans: Sequence[ContouredScan],
    count: int,
    seed: int,
    modes: Sequence[str] = MODES,
    errors: bool = True,
    progress: Progress = silent,
) -> VariantTable:
    """Segments `count` variants, drawn from the scans in turn; the same seed draws the same. errors : whether the surfaces'
    errors are estimated too, which takes as long again."""
    random = np.random.default_rng(seed)
    recipes = [drawn_recipe(random) for _ in range(count)]
    rows: list[VariantRow] = []
    for number, recipe in enumerate(recipes):
        progress(number / count, f"variant {number + 1} of {count}")
        rows += _rows(number, scans[number % len(scans)], recipe, seed + number, modes, errors)
    return {
        "rows": rows,
        "recipes": [asdict(recipe) for recipe in recipes],
        "summary": _summary(rows),
        "worse_than_auto": _worse_than_auto(rows),
        "confidence_rank_correlation": rank_correlation([r for r in rows if r["confidence"] is not None]),
    }


def variant_text(found: VariantTable) -> str:
    """The figures for a person."""
    lines = [
        f"{'organ':10}{'pointed at':12}{'variants':>9}{'median':>8}{'worst tenth':>13}{'not found':>11}{'said/true error':>17}"
    ]
    for row in found["summary"]:
        ratio = "" if row["said_over_true"] is None else f"{row['said_over_true']:.2f}"
        lines.append(
            f"{row['organ']:10}{row['mode']:12}{row['count']:9}{row['median']:8.3f}{row['worst_tenth']:13.3f}{row['not_found']:11}"
            f"{ratio:>17}"
        )
    told = ", ".join(f"{organ} {value:.2f}" for organ, value in found["confidence_rank_correlation"].items())
    lines.append(f"rank correlation of confidence and Dice: {told or 'too few rows'}")
    lines.append(f"pointed at, and more than 0.01 below the automatic result: {found['worse_than_auto']}")
    return "\n".join(lines)


def _rows(
    number: int, scan: ContouredScan, recipe: Recipe, seed: int, modes: Sequence[str], errors: bool
) -> list[VariantRow]:
    variant = variant_of(scan, recipe, seed)
    organs = [name for name in variant.masks if not name.startswith("bone")]
    masks = {name: variant.masks[name] for name in organs}
    rows: list[VariantRow] = []
    for mode in modes:
        try:
            found = {row.organ: row for row in dice_table(variant.ct, masks, (mode,), seed, errors)}
            failed = None
        except PalpateError as error:
            found, failed = {}, str(error)
        for organ in organs:
            row = found.get(organ)
            reference = masks[organ]
            cc = float(reference.array.sum() * np.prod(reference.spacing)) / 1000.0
            rows.append(
                {
                    "variant": number, "scan": scan.name, "organ": organ, "mode": mode,
                    "dice": 0.0 if row is None else round(row.dice, 4),
                    "volume_cc": 0.0 if row is None else round(row.volume_cc, 2),
                    "reference_cc": round(cc, 2),
                    "confidence": None if row is None else row.confidence,
                    "said_mm": None if row is None else row.said_mm,
                    "true_mm": None if row is None else row.true_mm,
                    "failed": failed,
                }
            )  # fmt: skip
    return rows


def _summary(rows: Sequence[VariantRow]) -> list[VariantSummary]:
    summary: list[VariantSummary] = []
    for organ, mode in sorted({(row["organ"], row["mode"]) for row in rows}):
        ours = [row for row in rows if (row["organ"], row["mode"]) == (organ, mode)]
        dice = np.array([row["dice"] for row in ours])
        summary.append(
            {
                "organ": organ, "mode": mode, "count": len(dice), "median": round(float(np.median(dice)), 4),
                "worst_tenth": round(float(np.quantile(dice, WORST)), 4), "not_found": int((dice == 0.0).sum()),
                "said_over_true": _said_over_true(ours),
            }
        )  # fmt: skip
    return summary


def _said_over_true(rows: Sequence[VariantRow]) -> float | None:
    ratios = [row["said_mm"] / max(row["true_mm"], 1e-3) for row in rows if row["said_mm"] and row["true_mm"]]
    return round(float(np.median(ratios)), 3) if ratios else None


def _worse_than_auto(rows: Sequence[VariantRow]) -> int:
    auto = {(row["variant"], row["organ"]): row["dice"] for row in rows if row["mode"] == "auto"}
    return sum(
        row["mode"] != "auto" and row["dice"] < auto.get((row["variant"], row["organ"]), 0.0) - 0.01 for row in rows
    )
