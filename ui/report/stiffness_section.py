"""The report's section on the stiffness itself, and the limits that belong beside the first figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from palpate.core.files.json_types import known
from palpate.ui.report.document import Block, Bullets, Paragraph, Picture, Section, Table
from palpate.ui.report.figures import Figures
from palpate.ui.report.map_words import told_places
from palpate.ui.report.measured_regions import lines_table, measured_table
from palpate.ui.report.record import CaseRecord
from palpate.ui.report.regions import RegionStiffness, in_words
from palpate.ui.words.number_words import three_figures

MU_NOTE = (
    "G = 2 (\u03bc1 + \u03bc2) is the small-strain shear modulus; Young's modulus, which elastography often gives, is E = 3 G in such "
    "tissue. The kPa of the MaterialCloning paper are \u03bc: its value compares with the mean of \u03bc1 and \u03bc2 here, a quarter "
    "of G. One pair cannot separate \u03bc1 from \u03bc2; they are set equal unless said otherwise."
)
_OTHER_LAW = (
    "The organ's law is {}: G is its initial shear modulus, of small strain; Young's modulus, which elastography often gives, is E = 3 G "
    "in such tissue."
)
_SAID = (
    "\u03bc1 and \u03bc2 cannot be told apart by one pair",
    "only G = ",
    "all stiffness is relative",
    "G is the initial shear modulus",
)
_DASH = "\N{EN DASH}"
_HEADER = ("region", "G, kPa", "sd, kPa", "95 % interval, kPa", "\u03bc1, kPa", "\u03bc2, kPa", "mean \u03bc, kPa")
_MU = 4


def limits(record: CaseRecord) -> str:
    """What a reader of the summary might take it to say, and it does not."""
    many = len(record.regions) > 1
    found = record.result.stiffness_map
    told_somewhere = None if found is None else known(found.places)
    beyond = ", beyond the places that the map outlines" if told_somewhere else ""
    places = f"{'each half' if many else 'the organ'} has one value, over which a focus within it is spread"
    return (
        "What this does not show: stiffness in absolute terms, which needs a known force; what the stiff tissue is, a tumour or anything "
        f"else; where within {'a half' if many else 'the organ'} it lies{beyond}: {places}. Left and right are the patient's. G is the "
        "shear modulus: Young's modulus, which elastography often gives, is three times that."
    )


def stiffness_section(record: CaseRecord, figures: Figures) -> Section:
    """Values, intervals, what the pair tells, and their pictures."""
    options = known(record.result.options)
    law = "" if options is None else options.other_law
    blocks: list[Block] = [
        _values(record.regions, not law),
        Paragraph(_OTHER_LAW.format(law) if law else MU_NOTE, "small"),
        Paragraph("What this pair determines:"),
        Bullets(told(record.result.identifiability.verdict, record.result.parameters)),
        *_places(record),
        *shown(figures.pictures, "stiffness_series", "anatomy", "stiffness_map"),
        *measured_table(record.measured),
        *lines_table(record.lines),
        *figures.interactive,
    ]
    return Section("Stiffness", blocks)


def _places(record: CaseRecord) -> list[Block]:
    """What the map says of places within a half, where there is one."""
    found = record.result.stiffness_map
    words = "" if found is None else told_places(found, record.result.parameters)
    return [Paragraph(words)] if words else []


def told(verdict: str, names: Mapping[str, object]) -> list[str]:
    """The parts of a verdict of result.json, in the report's words, without those that the note on G and the summary
    have said.

    names : of the regions.
    """
    words = in_words(verdict, names).replace("mu1", "\u03bc1").replace("mu2", "\u03bc2")
    parts = [part.strip().rstrip(".") for part in words.split(";")]
    return [part for part in parts if not part.startswith(_SAID)] or parts


def _values(regions: Sequence[RegionStiffness], with_mu: bool) -> Table:
    """with_mu : with the constants of Mooney-Rivlin."""
    rows = [_row(region, with_mu) for region in regions]
    header = _HEADER if with_mu else _HEADER[:_MU]
    if any(row[-1] for row in rows):
        return Table((*header, ""), rows)
    return Table(header, [row[:-1] for row in rows])


def _row(region: RegionStiffness, with_mu: bool) -> tuple[str, ...]:
    ci = _DASH if region.ci is None else f"{three_figures(region.ci[0])} to {three_figures(region.ci[1])}"
    note = "at bound" if region.at_bound else "" if region.determined else "not determined"
    sd = _DASH if region.sd is None else three_figures(region.sd)
    mu = [three_figures(value) for value in (region.mu1, region.mu2, region.mu_mean)] if with_mu else []
    return region.words, three_figures(region.G), sd, ci, *mu, note


def shown(pictures: Mapping[str, Picture], *names: str) -> Sequence[Picture]:
    """Those of the pictures that there are."""
    return [pictures[name] for name in names if name in pictures]
