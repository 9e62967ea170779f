"""How well the segmentation agrees with drawn contours, by what a person points at; and whether its confidence tells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypedDict, final

from scipy.stats import spearmanr

from palpate.core.worker.progress import Progress, silent
from palpate.validate.segmentation.contoured_scan import ContouredScan
from palpate.validate.segmentation.dice import JITTERED, MODES, DiceFigures, dice_table

# The least that is wanted: Dice, and for bone the share of the drawn femoral heads that is found.
WANTED = {
    ("prostate", "extremes"): 0.85, ("bladder", "extremes"): 0.92, ("rectum", "extremes"): 0.75,
    ("prostate", "click"): 0.70, ("bladder", "click"): 0.88,
    ("prostate", "auto"): 0.65, ("bladder", "auto"): 0.85, ("bone", "auto"): 0.95,
}  # fmt: skip
WANTED_SECONDS = 60.0
ALL_MODES = (*MODES, JITTERED)


class Sure(TypedDict):
    """What every row of a table has that says how sure a method is of an organ."""

    organ: str
    dice: float
    confidence: float | None


class JudgedRow(DiceFigures):
    """One scan, organ and mode beside the least that is wanted (None: nothing is)."""

    scan: str
    wanted: float | None
    reached: bool


@final
class SegmentationTable(TypedDict):
    """Rows, how many of those with a wanted value reach it, and rank correlation of confidence and Dice by organ."""

    rows: list[JudgedRow]
    reached: int
    wanted: int
    slowest_seconds: float
    wanted_seconds: float
    confidence_rank_correlation: dict[str, float]


def segmentation_study(
    scans: Sequence[ContouredScan],
    modes: Sequence[str] = ALL_MODES,
    seed: int = 1,
    errors: bool = True,
    progress: Progress = silent,
) -> SegmentationTable:
    """Rows of every scan, organ and mode beside what is wanted; JSON-able. errors : whether the surfaces' errors are estimated too,
    which takes as long again. Raises InputError for an unknown mode."""
    rows: list[JudgedRow] = []
    for number, scan in enumerate(scans):
        for step, mode in enumerate(modes):
            progress((number + step / len(modes)) / len(scans), f"{scan.name}: {mode}")
            rows += [
                _judged(scan.name, row.to_dict()) for row in dice_table(scan.ct, scan.masks, (mode,), seed, errors)
            ]
    judged = [row for row in rows if row["wanted"] is not None]
    return {
        "rows": rows,
        "reached": sum(row["reached"] for row in judged),
        "wanted": len(judged),
        "slowest_seconds": max(row["seconds"] for row in rows),
        "wanted_seconds": WANTED_SECONDS,
        "confidence_rank_correlation": rank_correlation(rows),
    }


def study_text(found: SegmentationTable) -> str:
    """The table for a person."""
    lines = [f"{'scan':10}{'organ':10}{'pointed at':12}{'Dice':>7}{'inside':>8}{'wanted':>8}{'cc':>8}{'drawn':>8}"
             f"{'off mm':>8}{'sure':>7}{'said mm':>9}{'true mm':>9}{'s':>6}"]  # fmt: skip
    for row in found["rows"]:
        wanted = "" if row["wanted"] is None else f"{row['wanted']:.2f}"
        sure = "" if row["confidence"] is None else f"{row['confidence']:.2f}"
        said, true = ("" if row[key] is None else f"{row[key]:.1f}" for key in ("said_mm", "true_mm"))
        lines.append(
            f"{row['scan']:10}{row['organ']:10}{row['mode']:12}{row['dice']:7.3f}{row['share_inside']:8.3f}{wanted:>8}"
            f"{row['volume_cc']:8.1f}{row['reference_cc']:8.1f}{row['shift_mm']:8.1f}{sure:>7}{said:>9}{true:>9}{row['seconds']:6.0f}"
            + ("" if row["reached"] else "  not reached")
        )
    told = ", ".join(f"{organ} {value:.2f}" for organ, value in found["confidence_rank_correlation"].items())
    lines.append(f"rank correlation of confidence and Dice: {told or 'too few rows'}")
    lines.append(f"reached {found['reached']} of {found['wanted']}; slowest {found['slowest_seconds']:.0f} s")
    return "\n".join(lines)


def rank_correlation(rows: Sequence[Sure]) -> dict[str, float]:
    """Spearman's correlation of confidence and Dice for each organ: 1 where the confidence puts all rows in their order."""
    found = {}
    for organ in sorted({row["organ"] for row in rows if row["confidence"] is not None}):
        pairs = [(row["confidence"], row["dice"]) for row in rows if row["organ"] == organ]
        if len({sure for sure, _ in pairs}) > 1 and len({good for _, good in pairs}) > 1:
            found[organ] = round(float(spearmanr(*zip(*pairs, strict=True)).statistic), 3)
    return found


def _judged(scan: str, row: DiceFigures) -> JudgedRow:
    wanted = WANTED.get((row["organ"], row["mode"]))
    value = row["share_inside"] if row["organ"] == "bone" else row["dice"]
    return {"scan": scan, **row, "wanted": wanted, "reached": wanted is None or value >= wanted}
