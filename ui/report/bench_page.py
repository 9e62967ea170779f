"""The report of a body on a bench: what was found, every state with its markers, forces, ranking and provenance."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.case.diagnosed import read_diagnosis
from palpate.case.stated_files import bench_body
from palpate.core.diagnose.diagnosis_record import DiagnosisRecord, MarkersRecord
from palpate.core.files.json_types import known
from palpate.ui.pictures.bench_pictures import body_in_state, magnification
from palpate.ui.pictures.slices import save
from palpate.ui.report.diagnosis_words import FALSE_ALARMS, VERDICTS, chance, gap_is_seen, plain
from palpate.ui.report.document import Block, Bullets, Document, Notice, Paragraph, Picture, Section, Table
from palpate.ui.report.gap_section import ranking_table, stiffness_interval
from palpate.ui.words.number_words import three_figures

_DASH = "\N{EN DASH}"


def bench_document(case: CaseFolder, folder: Path, date: str, version: str) -> Document:
    """The whole report of a diagnosed body; pictures are written into ``folder``. Raises InputError for a damaged case."""
    found = read_diagnosis(case)
    sections = [
        Section("Summary", _summary(found)),
        Section("States", [*_states(found), *_pictures(case, found, folder)]),
        *([Section("What the model leaves out", _ranked(found))] if gap_is_seen(found) else []),
        Section("Appendix: provenance", [_provenance(case, found, date, version)]),
    ]
    subtitle = f"Case {case.facts.name} \N{MIDDLE DOT} {date} \N{MIDDLE DOT} Palpate {version}"
    simulated = [Notice("Simulated data: the markers were computed, not measured.")] if known(found.simulated) else []
    return Document("Stiffness of a body on a bench", subtitle, sections, simulated)


def _summary(found: DiagnosisRecord) -> list[Block]:
    gap, stiffness = found.gap, found.stiffness
    rows = [
        ("verdict", VERDICTS.get(found.verdict, plain(found.verdict))),
        (
            "shear modulus G without an effect, kPa (95 % interval)",
            stiffness_interval(stiffness.without_effect["body"]),
        ),
    ]
    if stiffness.with_effect is not None:
        name = plain(found.ranking[0].effect)
        rows.append((f"G with {name}, kPa (95 % interval)", stiffness_interval(stiffness.with_effect["body"])))
    rows += [
        ("Young's modulus, for comparison, kPa", _youngs_modulus(found)),
        ("markers missed by the plain model", f"{gap.rms_mm:.2f} mm rms, 95 % below {gap.p95_mm:.2f} mm"),
        ("their own error would leave", f"{gap.noise_floor_mm:.2f} mm rms"),
        ("chance of such a gap without any effect", chance(gap.p_value)),
    ]
    blocks: list[Block] = [Paragraph(found.in_words, "lead")]
    if found.why:
        blocks.append(Paragraph(f"{found.why[0].upper()}{found.why[1:]}."))
    blocks.append(Table(("", ""), rows, numbers=False))
    if gap_is_seen(found):
        blocks.append(Paragraph(FALSE_ALARMS, "small"))
    if found.next_measurement:
        blocks.append(Notice(f"To settle it, measure next: {found.next_measurement}."))
    return [*blocks, Bullets(found.flags)] if found.flags else blocks


def _youngs_modulus(found: DiagnosisRecord) -> str:
    """Of the value to quote: three times G, for the body hardly changes its volume."""
    fitted = (found.stiffness.with_effect or found.stiffness.without_effect)["body"]
    return f"{three_figures(3.0 * fitted.G_kpa)} (three times G)"


def _states(found: DiagnosisRecord) -> list[Block]:
    states = known(found.states) or []
    header = ("state", "markers", "their error", "missed", "with the effect", "predicted", "predicted with it")
    rows = [
        (
            s.name,
            str(known(s.markers) or _DASH),
            *(
                _mm(known(v))
                for v in (s.noise_mm, s.rms_before_mm, s.rms_after_mm, s.held_out_before_mm, s.held_out_after_mm)
            ),
        )
        for s in states
    ]
    caption = (
        "Markers of every state, mm rms: what their own error would leave, what the plain model misses, and the model with "
        "the likeliest effect. Predicted: by a model that was fitted to the other states alone."
    )
    blocks: list[Block] = [Table(header, rows, caption, numbers=False)]
    forces = [row for state in states for row in _forces(state)]
    if forces:
        of_forces = ("state", "patch, axis", "measured, N", "plain model, N", "with the effect, N")
        blocks.append(
            Table(of_forces, forces, "Reaction forces, on the body; ± is one standard deviation", numbers=False)
        )
    return blocks


def _forces(state: MarkersRecord) -> list[tuple[str, ...]]:
    return [
        (
            state.name,
            f"{r.patch}, {r.axis}",
            f"{r.measured_n:.3f} ± {r.sd_n:.3f}",
            *(_newton(v) for v in (r.before_n, r.after_n)),
        )
        for r in known(state.reactions) or []
    ]


def _mm(value: float | None) -> str:
    return _DASH if value is None else f"{value:.2f}"


def _newton(value: float | None) -> str:
    return _DASH if value is None else f"{value:.3f}"


def _pictures(case: CaseFolder, found: DiagnosisRecord, folder: Path) -> list[Picture]:
    """One picture of every state; none where the arrays are gone."""
    states = known(found.states) or []
    if not states or not case.has(found.where.map):
        return []
    maps = case.read_npz(found.where.map)
    missed = [np.sqrt(np.nansum(maps[f"state_{k + 1}/residual"] ** 2, axis=1)) for k in range(len(states))]
    times, limit = magnification(maps, len(states)), max(float(m.max(initial=0.0)) for m in missed)
    longer = "" if times == 1 else f", {times} times as long"
    which = "with the likeliest effect" if found.ranking else "by the plain model"
    return [
        Picture(
            save(body_in_state(maps, k, times, limit), folder / f"state_{k + 1}.png"),
            f"{state.name}: the body {which} (grey), its edges at rest (lines), markers where they were seen (dots), and what the "
            f"plain model misses of their motion (arrows from where it predicts them to where they were seen{longer}).",
            f"Two views of the body in the state {state.name} with arrows at its markers.",
        )
        for k, state in enumerate(states)
    ]


def _ranked(found: DiagnosisRecord) -> list[Block]:
    blocks: list[Block] = [ranking_table(found, "gain on states left out, mm")]
    remainder = known(found.remainder)
    if remainder is not None:
        left = ", ".join(f"{name} {value:.2f} mm" for name, value in remainder.rms_mm.items())
        cause = f" {plain(remainder.cause)} explains it." if remainder.cause else ""
        blocks.append(Paragraph(f"What the named effect leaves: {left}.{cause}"))
    return blocks


def _provenance(case: CaseFolder, found: DiagnosisRecord, date: str, version: str) -> Table:
    body, (low, high) = bench_body(case), case.facts.organ_shear_modulus_bounds_kpa
    rows = [
        ("body", f"{body.body}, density {body.density_kg_m3:g} kg/m3"),
        ("gravity in the plain model", "yes" if body.model_gravity else "no"),
        ("assumed", f"one stiffness, Poisson's ratio 0.495, G within {low:g} to {high:g} kPa"),
        (
            "chance that no effect of the library is the cause",
            f"{found.probability_unknown:.2g}, given that there is a gap",
        ),
        ("report", f"{date}, Palpate {version}"),
    ]
    return Table(("", ""), rows, numbers=False)
