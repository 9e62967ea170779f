"""The report's page on the sim-to-real gap, from diagnosis.json and its maps."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from msgspec import UNSET

from palpate.case.case_folder import CaseFolder
from palpate.case.diagnosed import DIAGNOSIS, otherwise_words, read_diagnosis
from palpate.core.diagnose.diagnosis_record import DiagnosisRecord, FittedStiffnessRecord, ParameterRecord
from palpate.core.files.json_types import known
from palpate.ui.pictures.gap_pictures import LONGER, force_planes, motion_planes, residual_views
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.slices import save
from palpate.ui.report.diagnosis_words import (
    FALSE_ALARMS,
    GAP_TITLE,
    VERDICTS,
    chance,
    gap_is_seen,
    in_grey,
    plain,
    says_little,
    two_stiffnesses,
)
from palpate.ui.report.document import Block, Bullets, Notice, Paragraph, Picture, Section, Table
from palpate.ui.report.record import CaseRecord
from palpate.ui.report.regions import region_words
from palpate.ui.words.number_words import measured, three_figures

_SHOWN = 6


def gap_pictures(case: CaseFolder, images: CaseImages, folder: Path) -> dict[str, Picture]:
    """The maps of a diagnosed case as PNG files in ``folder``; none where it saw no gap: the misfit in mm is shown already."""
    found = read_diagnosis(case) if case.has(DIAGNOSIS) else None
    if found is None or not gap_is_seen(found) or not case.has(found.where.map):
        return {}
    maps = case.read_npz(found.where.map)
    out = {
        "gap_residual": Picture(
            save(residual_views(maps), folder / "gap_residual.png"),
            "Not a distance: how many standard deviations (contours, walls and mesh together) the plain model's organ lies outside "
            "(orange) or inside (purple) of what the deformed scan shows, drawn on the organ at rest. "
            "Fit has the distance in mm. R, L, A, P, S, I as on the slices. "
            "Blank where the two halves meet: no distance is read there.",
            "The organ from four sides, coloured by the residual in standard deviations.",
            0.85,
        ),
        "gap_force": Picture(
            save(force_planes(images, maps), folder / "gap_force.png"),
            "The smallest smooth field of forces that would close the gap, within 7 mm of each slice. It shows where the "
            f"model is wrong, not why; a force at one point would appear spread over about {known(found.where.blur_mm) or 0.0:.0f} mm.",
            "Slices in three planes with arrows where forces are missing.",
        ),
    }
    if len(maps.get("motion/places", ())):
        out["gap_motion"] = Picture(
            save(motion_planes(images, maps), folder / "gap_motion.png"),
            "Where the plain model's motion and the one that the two images show differ, in and around the organ, within 7 mm of each "
            f"slice: arrows {LONGER:g} times as long as the difference, coloured by its size in standard deviations.",
            "Slices in three planes with arrows where the predicted motion differs from the one that the images show.",
        )
    return out


def gap_section(record: CaseRecord, pictures: Mapping[str, Picture]) -> Section:
    """What the model leaves out, in words, figures and maps, of a record with a diagnosis."""
    found = record.diagnosis
    assert found is not None
    blocks: list[Block] = [Paragraph(_lead(found), "lead")]
    otherwise = otherwise_words(record.result, found)
    if otherwise:
        blocks.append(Notice(f"On this page {otherwise}: run `palpate diagnose` again, without a flag."))
    if gap_is_seen(found):
        blocks.append(Paragraph(FALSE_ALARMS))
    blocks.append(_figures(found))
    blocks += [pictures[n] for n in ("gap_residual", "gap_motion", "gap_force") if n in pictures]
    if gap_is_seen(found):
        blocks += [ranking_table(found), *_told(_shrinkage(found)), *_told(_stiffness(found))]
    which = two_stiffnesses(record)
    blocks += [Paragraph(which)] if which else []
    if found.next_measurement:
        blocks.append(Notice(f"To settle it, measure next: {found.next_measurement}."))
    said = known(record.result.missing) or []  # the first pages say it already
    flags = [flag for flag in found.flags if flag not in said]
    blocks += [Bullets(flags)] if flags else []
    return Section(GAP_TITLE, blocks)


def _lead(found: DiagnosisRecord) -> str:
    """The finding in a sentence. Without a gap it states no distance: the one of Fit is the misfit."""
    if gap_is_seen(found) or says_little(found) or in_grey(found):
        return found.in_words
    return (
        f"The model explains what both scans show as well as their noise allows ({chance(found.gap.p_value)}): nothing in them says "
        "that it leaves anything out."
    )


def _figures(found: DiagnosisRecord) -> Table:
    gap, verdict = found.gap, found.verdict
    rows = [("verdict", VERDICTS.get(verdict, plain(verdict)))]
    if gap_is_seen(found):
        rows += [
            ("gap: what is left of the misfit when noise is smoothed out", f"{gap.rms_mm:.2f} mm rms, 95 % below {gap.p95_mm:.2f} mm"),
            ("noise would leave (contours, walls, voxels and mesh of this pair)", f"{gap.noise_floor_mm:.2f} mm rms"),
        ]  # fmt: skip
    rows.append(("chance of such a gap without any effect", chance(gap.p_value)))
    if found.posterior is not UNSET:
        rows.append(("probability that nothing is left out", f"{found.posterior['none']:.2f}"))
    if found.image is not UNSET:
        rows.append(("data", "contours and images" if found.image else "contours alone"))
    states = known(gap.states) or []
    if len(states) > 1:
        left = ", ".join(f"{state.rms_mm:.2f} (noise {state.noise_floor_mm:.2f})" for state in states)
        rows.append(("of that, in each deformed state", f"{left} mm rms; maps and slices show the first"))
    return Table(("", ""), rows, numbers=False)


def ranking_table(found: DiagnosisRecord, gain_header: str = "gain on left-out data, mm") -> Table:
    """Effects by their probability. gain_header : of the column of gains."""
    header = ("effect", "probability", gain_header, "parameters")
    rows = []
    for row in found.ranking[:_SHOWN]:
        parameters = ", ".join(
            f"{name.replace('_', ' ')} {_size(p)} {p.unit if p.unit != '1' else ''}".strip()
            for name, p in row.parameters.items()
        )
        gain = f"{round(row.cv_gain_mm, 2) + 0.0:.2f}"  # + 0.0: no "-0.00"
        rows.append((plain(row.effect), _share(row.probability), gain, parameters))
    return Table(
        header,
        rows,
        "Effects by their probability, given that there is a gap; ± is one standard deviation",
        numbers=False,
    )


def _size(p: ParameterRecord) -> str:
    return "not known" if p.value is None or p.sd is None else measured(p.value, p.sd)


def _share(probability: float) -> str:
    """A probability that is neither nothing nor certain is not written as either."""
    return "below 0.01" if probability < 0.005 else f"{min(probability, 0.99):.2f}"


def _told(table: Table | None) -> list[Block]:
    return [] if table is None else [table]


def _shrinkage(found: DiagnosisRecord) -> Table | None:
    s = found.shrinkage
    if s is None:
        return None
    low, high = (100.0 * v for v in s.ci95)
    before, after = s.held_out_rms_before_mm, s.held_out_rms_after_mm
    rows = [
        ("rms on patches left out, without and with the effect", f"{before:.2f} and {after:.2f} mm"),
        ("share of the model's own error that is gone", f"{100 * s.noise_corrected_fraction:.0f} % ({low:.0f} to {high:.0f} %)"),
        ("the same for a free smooth field of forces", f"{100 * s.ceiling_fraction:.0f} %"),
    ]  # fmt: skip
    name = plain(s.effect)
    return Table(("", ""), rows, f"How far the gap shrinks with {name}", numbers=False)


def _stiffness(found: DiagnosisRecord) -> Table | None:
    without, fuller = found.stiffness.without_effect, found.stiffness.with_effect
    if fuller is None:
        return None
    rows = [
        (region_words(name, len(without) == 1), stiffness_interval(values), stiffness_interval(fuller[name]))
        for name, values in without.items()
    ]
    header = ("region", "G without the effect, kPa (95 % interval)", "G with it, kPa (95 % interval)")
    return Table(header, rows, "Stiffness without the effect and with it")


def stiffness_interval(values: FittedStiffnessRecord) -> str:
    """``33.2 (22.7 to 48.7)``: the interval that the diagnosis gives; without one, normal in ln G, whose sd it gives as G sinh(sd)."""
    told = known(values.ci95_kpa)
    if told is not None:
        return f"{three_figures(values.G_kpa)} ({three_figures(told[0])} to {three_figures(told[1])})"
    G, sd = values.G_kpa, float("nan") if values.sd_kpa is None else values.sd_kpa
    factor = float(np.exp(1.96 * np.arcsinh(sd / G)))
    return f"{three_figures(G)} ({three_figures(G / factor)} to {three_figures(G * factor)})"
