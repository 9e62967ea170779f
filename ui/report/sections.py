"""The sections of a report, from what the case's files say."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import UNSET

from palpate.case.history import Entry
from palpate.ui.report.document import Block, Document, Notice, Paragraph, Picture, Section, Table
from palpate.ui.report.figures import Figures
from palpate.ui.report.first_page import minute
from palpate.ui.report.gap_section import gap_section
from palpate.ui.report.motion_section import motion_section
from palpate.ui.report.quality import Volumes, quality
from palpate.ui.report.record import CaseRecord
from palpate.ui.report.stiffness_section import limits, shown, stiffness_section
from palpate.ui.report.summary import first_sentences, headline, summary
from palpate.ui.report.trust import trust_box
from palpate.ui.words.number_words import three_figures

# Of a checksum, enough to tell two files apart; result.json has all of them.
_DIGITS = 12


def document(
    record: CaseRecord, figures: Figures, date: str, version: str, exported_cc: Volumes | None = None
) -> Document:
    """The whole report. date : of this report, as text. exported_cc : volumes on the voxels of the CT, cc, by state and label."""
    pictures = figures.pictures
    notices = [Notice(f"Simulated data: {record.simulated}.")] if record.simulated else []
    sections = (
        Section("Summary", _summary(record, pictures)),
        _particulars(record, pictures),
        stiffness_section(record, figures),
        _fit(record, pictures),
        *([motion_section(record.matched, pictures, record.used_image)] if record.matched else []),
        *([gap_section(record, pictures)] if record.diagnosis else []),
        quality(record, figures.missing, exported_cc),
        _appendix(record, date, version),
    )
    subtitle = f"Case {record.facts.name} \N{MIDDLE DOT} {date} \N{MIDDLE DOT} Palpate {version}"
    return Document("Stiffness from two CT scans", subtitle, sections, notices)


def _summary(record: CaseRecord, pictures: Mapping[str, Picture]) -> list[Block]:
    """The first page: what was found in a sentence, how sure it is and why, and one picture with its scale."""
    return [Paragraph(headline(record), "lead"), trust_box(record), *shown(pictures, "stiffness_planes")]


def _particulars(record: CaseRecord, pictures: Mapping[str, Picture]) -> Section:
    """What was scanned, what the values stand on, what is missing, and published values."""
    rest = [Paragraph(text) for text in summary(record)[len(first_sentences(record)) :]]
    blocks = [*minute(record), *rest, Paragraph(limits(record)), *shown(pictures, "published")]
    return Section("Basis of the result", blocks)


def _fit(record: CaseRecord, pictures: Mapping[str, Picture]) -> Section:
    misfit = record.result.misfit
    rows = [
        ("rms distance of predicted from observed surface", f"{misfit.rms_mm:.2f} mm"),
        ("95 % of the surface is closer than", f"{misfit.p95_mm:.2f} mm"),
        ("greatest distance (one-sided Hausdorff)", f"{misfit.hausdorff_mm:.2f} mm"),
        (
            "sum of squared distances (Eq 13 of the MaterialCloning paper)",
            f"{three_figures(misfit.objective_mm2)} mm\u00b2",
        ),
    ]
    if misfit.rms_before_mm is not UNSET:
        rows.insert(0, ("rms distance of the two observed surfaces, for comparison", f"{misfit.rms_before_mm:.2f} mm"))
    noise, expected = record.noise_sd_mm, record.expected_misfit_mm
    unknown = "both are one contour, carried over by the images" if record.carried_over else "not known"
    rows.append(
        ("repeatability of one contour (sd)", unknown if noise is None else f"{noise:.2f} mm, {record.noise_from}"),
    )
    if expected is not None:
        rows.append(("rms distance that this noise alone would leave", f"{expected:.2f} mm"))
    blocks: list[Block] = [
        Table(("distance of surfaces", ""), rows),
        *shown(pictures, "deformation_planes", "misfit"),
    ]
    return Section("Fit", blocks)


def _appendix(record: CaseRecord, date: str, version: str) -> Section:
    """How it was computed: method, singular values, and hashes of what went in."""
    result, facts = record.result, record.facts
    solver = result.solver
    low, high = facts.organ_shear_modulus_bounds_kpa
    singular = ", ".join(f"{value:.3g}" for value in result.identifiability.singular_values)
    rows = [
        ("method", f"{result.method}, boundary {result.boundary}, seed {result.seed}"),
        ("work", f"{solver.forward_solves} equilibria ({solver.failed} failed), {solver.seconds:.0f} s"),
        ("assumed", f"tissue G {facts.tissue_shear_modulus_kpa:g} kPa, Poisson's ratio {facts.tissue_poisson_ratio:g}; "
                    f"organ G within {low:g} to {high:g} kPa"),
        ("singular values", f"{singular}: of the sensitivities to ln G, weighed by the noise"),
        ("versions", ", ".join(f"{name} {v}" for name, v in result.versions.items())),
        ("report", f"{date}, Palpate {version}"),
    ]  # fmt: skip
    rows += [("command", _command(entry)) for entry in record.history]
    sums = ", ".join(f"{name} {str(value)[:_DIGITS]}" for name, value in result.inputs_sha256.items())
    rows += [("sha256, first digits", sums)] if sums else []
    table = Table(("", ""), rows, numbers=False)
    return Section("Appendix: method, provenance", [table])


def _command(entry: Entry) -> str:
    """As it would be typed again, its paths called what the help calls them."""
    typed = " ".join(text for text in ("palpate", entry.get("command", ""), entry.get("options", "")) if text)
    return f"{typed} ({entry['date']})" if "date" in entry else typed
