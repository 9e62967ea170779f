"""What the second scan's image adds: stiffness and diagnosis on pairs of real CTs whose second state is simulated. Nothing is
hidden, or one effect in each pair.

The truth is sealed before any pair is analysed, see `validate.sealed`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from palpate.core.errors import InputError
from palpate.core.statistics import rms
from palpate.core.worker.progress import Progress, part, silent
from palpate.validate.images.diagnosis_score import score_text
from palpate.validate.images.figures import half_rows, sd_by_half, way_row
from palpate.validate.images.pairs import MAKING, make_pair, name_of, unmade
from palpate.validate.images.records import HalfRow, ImagesOptions, ImagesTable
from palpate.validate.images.said import Said, said_of
from palpate.validate.images.ways import DONE, WAYS, analyse
from palpate.validate.sealed import Kind, SealedStudy, make_each
from palpate.validate.segmentation.contoured_scan import contoured_scan

# The way with whose standard deviations those of the others are compared.
_PLAIN = "contours"
# Upper over lower end up to which an interval is called useful.
_FACTOR = 4.0
# What a ledger is of that does not say so.
_UNLESS_SAID: Kind = {
    "study": "another",
    "seed": None,
    "scans": [],
    "hide": [],
    "ways": [],
    "making": 1,
    "contour_error": None,
    "diagnosis": True,
}


def run(folder: Path, options: ImagesOptions, progress: Progress = silent) -> ImagesTable:
    """Make pairs in folder/cases, answers in folder/answers, the ledger in folder/ledger.json; return the figures.

    A run that was stopped goes on. Raises InputError for scans that cannot be read, and when the folder holds another study.
    """
    for ct, contours in options.scans:  # a study is not begun with what cannot be read
        contoured_scan(ct, contours, ct.name)
    sealed = SealedStudy(folder, DONE)
    sealed.begin(_kind(options), _UNLESS_SAID, _flags)
    make_each(
        partial(make_pair, options, folder=folder), range(options.pairs), options.workers, part(progress, 0.0, 0.3)
    )
    names = sealed.made([name_of(k) for k in range(options.pairs)])
    if not names:
        raise InputError(f"no pair of {folder} could be simulated; give another --seed")
    sealed.seal(names)
    sealed.analyse(names, partial(_analysed, options), options.workers, part(progress, 0.3, 0.99))
    sealed.check_unchanged()
    return table(sealed, options, names)


def table(sealed: SealedStudy, options: ImagesOptions, names: list[str]) -> ImagesTable:
    """The figures of the pairs that were analysed."""
    gone = [way for way in WAYS if way in options.ways or not options.ways]
    by_way = {way: [found for name in names if (found := _said(sealed, name, way))] for way in gone}
    plain = sd_by_half(by_way.get(_PLAIN, []))
    return {
        "study": "images",
        "seed": options.seed,
        "rows": [way_row(way, said, len(names), plain, options.seed) for way, said in by_way.items()],
        "halves": [row for said in by_way.values() for of in said for row in half_rows(of)],
        "short": options.pairs - len(names),
        "unmade": {name: why for k in range(options.pairs) if (why := unmade(sealed.folder, name := name_of(k)))},
        "ledger": str(sealed.ledger_path),
    }


def images_text(found: ImagesTable) -> str:
    """The table for a person."""
    lines = [
        f"{'pair':11}{'way':10}{'half':16}{'true':>7}{'found':>8}{'95 % interval':>18}{'sd ln G':>9}{'z':>7}  verdict"
    ]
    for h in found["halves"]:
        interval = f"{h['interval_kpa'][0]:.1f} to {h['interval_kpa'][1]:.1f}"
        p = "" if h["p_value"] is None else f" (p {h['p_value']:.2g})"
        names = f": {', '.join(h['candidates'])}" if h["candidates"] else ""
        changes = f"  changed: {', '.join(h['changes'])}" if h["changes"] else ""
        hides = f"  hides {h['hidden']}, {h['left_mm'] or 0.0:.2f} mm" if h["hidden"] else ""
        lines.append(
            f"{h['pair']:11}{h['way']:10}{h['half']:16}{h['true_kpa']:7.1f}{h['found_kpa']:8.1f}{interval:>18}"
            f"{h['sd_ln_G']:9.2f}{h['z']:+7.2f}  {h['verdict']}{names}{p}{hides}{changes}"
        )
    for row in found["rows"]:
        halves = row["halves"]
        if halves is None:
            lines.append(f"{row['way']}: no answer on any pair")
            continue
        held, z = halves["intervals"][-1], [h["z"] for h in found["halves"] if h["way"] == row["way"]]
        within = _within_a_factor(found["halves"], row["way"])
        told = ", ".join(f"{verdict} {count}" for verdict, count in sorted(row["verdicts"].items()))
        lines.append(
            f"{row['way']}: {round(held['holds'] * halves['cases'])} of {halves['cases']} intervals hold; z mean {np.mean(z):+.2f}, "
            f"rms {rms(z):.2f}; sd of ln G {halves['sd_ln_G']:.2f}, {row['sd_ratio'] or 0:.2f} of that of contours alone; "
            f"both intervals within a factor of {_FACTOR:g} in {within} pairs; "
            f"{row['failed']} without an answer; verdicts: {told or 'none made'}"
        )
        lines += [
            f"  {effect}: of {n['pairs']} pairs a candidate in {n['candidate']}, the only name in {n['alone']}, an alarm in {n['alarm']}, "
            f"another name alone in {n['other']}"
            for effect, n in row["found"].items()
        ]
        lines += score_text(row["score"]) if row["score"] else []
    lines.append(f"{found['short']} pairs could not be simulated")
    lines += [f"  {name}: {why[-1]}" for name, why in found["unmade"].items()]
    return "\n".join(lines)


def _within_a_factor(halves: Sequence[HalfRow], way: str) -> int:
    """Pairs in which the interval of every half ends at no more than _FACTOR times where it begins."""
    span: dict[str, float] = {}
    for half in halves:
        if half["way"] == way:
            low, high = half["interval_kpa"]
            span[half["pair"]] = max(span.get(half["pair"], 1.0), high / low)
    return sum(value <= _FACTOR for value in span.values())


def _said(sealed: SealedStudy, name: str, way: str) -> Said | None:
    return said_of(sealed.cases / name / way, sealed.answers / f"{name}.json", way)


def _analysed(options: ImagesOptions, pair: Path) -> None:
    stated = None if options.contour_error is None else options.contour_error[0]
    analyse(pair, options.timeout_s, options.ways, stated, options.diagnosis)


def _kind(options: ImagesOptions) -> Kind:
    return {
        "study": "images",
        "seed": options.seed,
        "scans": [[str(ct.absolute()), str(labels.absolute())] for ct, labels in options.scans],
        "hide": list(options.hide),
        "ways": list(options.ways),
        "contour_error": options.contour_error and list(options.contour_error),
        "diagnosis": options.diagnosis,
        "making": MAKING,
    }


def _flags(kind: Kind) -> str:
    scans, hide, ways = kind["scans"], kind["hide"], kind["ways"]
    assert isinstance(scans, list)
    assert isinstance(hide, list)
    assert isinstance(ways, list)
    if kind["study"] != "images":
        return "another command"
    words = [f"--seed {kind['seed']}", *(f"--scan {ct} {labels}" for ct, labels in scans)]
    words += [f"--hide {effect}" for effect in hide] + [f"--way {way}" for way in ways]
    if isinstance(error := kind["contour_error"], list):
        words.append(f"--contour-error {error[0]:g} {error[1]:g}")
    words += [] if kind["diagnosis"] else ["--no-diagnosis"]
    return f"{' '.join(words)} (pairs made in way {kind['making']})"
