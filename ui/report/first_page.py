"""What was scanned, what was found and how sure it is, published values, what is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.case.case_folder import STATES
from palpate.ui.pictures.published_scale import Row
from palpate.ui.report.document import Block, Bullets, Paragraph, Table
from palpate.ui.report.record import CaseRecord
from palpate.ui.report.regions import RegionStiffness
from palpate.ui.report.trust import SURE_RULE, how_sure, missing
from palpate.ui.words.number_words import three_figures

_DASH = "\N{EN DASH}"


@dataclass(frozen=True)
class Published:
    """what : was measured. modulus : "E" or "G", as the authors give it; value and span of it, kPa. source : its number."""

    what: str
    modulus: str
    value: float
    span: tuple[float, float] | None
    source: int

    @property
    def row(self) -> Row:
        """On the scale of G, which is a third of E in a tissue that keeps its volume."""
        share = 1.0 / 3.0 if self.modulus == "E" else 1.0
        span = None if self.span is None else (share * self.span[0], share * self.span[1])
        return Row(f"{self.what} [{self.source}]", share * self.value, span)


# Young's moduli E or shear moduli as their authors give them, kPa, with a range where they state one; which source.
PUBLISHED = (
    Published("benign cores", "E", 42.3, None, 1),
    Published("malignant cores", "E", 71.1, None, 1),
    Published("cancer", "E", 58.0, (30.0, 110.0), 2),
    Published("suspicious area without cancer", "E", 30.8, None, 3),
    Published("suspicious area with cancer", "E", 64.1, None, 3),
    Published("whole gland, hyperplasia", "G", 4.40, None, 4),
)
# How it was measured, and where that is said.
SOURCES = {
    1: ("shear wave ultrasound, 504 cores", "doi:10.1177/03915603231167650"),
    2: ("the same, 53 patients, with range", "PMID 22357224"),
    3: ("the same in 3D, 12 patients", "doi:10.3892/br.2018.1059"),
    4: ("MR elastography, 10 patients", "doi:10.1186/s43055-021-00679-8"),
}
_OF_THE_ORGAN = " of the prostate"
_HERE = "Found here, with its 95 % interval (black), and published"
_PUBLISHED_NOTE = (
    "for the prostate (grey; a third of Young's modulus where that is given). Methods differ by more than tissues do; kPa here are "
    "relative to an assumed tissue. "
)


def scanned(record: CaseRecord) -> Table | None:
    """What was scanned: date, scanner, series, slices and voxels of both scans; None where the case came without a CT."""
    rows = []
    for state in STATES:
        scan = record.scans.get(state)
        if scan is not None:
            voxel = " \N{MULTIPLICATION SIGN} ".join(f"{edge:.3g}" for edge in scan.voxel_mm)
            facts = (scan.date, scan.scanner, scan.series, str(scan.slices), f"{voxel} mm")
            rows.append((state, *(fact or _DASH for fact in facts)))
    return Table(("scan", "date", "scanner", "series", "slices", "voxel"), rows, numbers=False) if rows else None


def found(record: CaseRecord) -> Table:
    """Each region with its volume, G, interval and a word for how sure it is; the whole prostate's volume where it has halves."""
    volumes = record.volumes_cc.get("rest", {})
    rows = [
        (region.words, _cc(volumes.get(region.name)), *_value(region), how_sure(region, record))
        for region in record.regions
    ]
    halves = [volumes[region.name] for region in record.regions if region.name in volumes]
    if len(halves) > 1:
        # Parallel and series averages bound what a whole of two parts can have (Voigt 1889, Reuss 1929).
        told = all(region.determined for region in record.regions) and len(halves) == len(record.regions)
        rows.append(
            ("whole prostate", _cc(sum(halves)), _between(record.regions, halves) if told else _DASH, _DASH, "")
        )
    return Table(("region", "volume at rest", "G, kPa", "95 % interval, kPa", "how sure"), rows, numbers=False)


def minute(record: CaseRecord) -> list[Block]:
    """Tables of what was scanned and found, and what is missing."""
    scans = scanned(record)
    told: list[Block] = [] if scans is None else [scans]
    told += [found(record), Paragraph(f"{SURE_RULE} Whole prostate: between which its average lies.", "small")]
    lacks = missing(record)
    return [*told, Paragraph("What is missing:"), Bullets(lacks)] if lacks else told


def scale_rows(record: CaseRecord) -> list[Row]:
    """What this pair tells, then what others have measured."""
    names = [
        (f"here: {region.words.removesuffix(_OF_THE_ORGAN)}", region) for region in record.regions if region.determined
    ]
    ours = [Row(words, region.G, region.ci, found=True) for words, region in names]
    return ours + [one.row for one in PUBLISHED]


def scale_caption(rows: Sequence[Row]) -> str:
    """What the scale shows, and where its values are from."""
    sources = "; ".join(f"[{number}] {how}, {where}" for number, (how, where) in SOURCES.items())
    return f"{_HERE if rows[0].found else 'Published'} {_PUBLISHED_NOTE}{sources}."


def _value(region: RegionStiffness) -> tuple[str, str]:
    if not region.determined:
        return _DASH, _DASH
    interval = _DASH if region.ci is None else f"{three_figures(region.ci[0])} to {three_figures(region.ci[1])}"
    return three_figures(region.G), interval


def _between(regions: Sequence[RegionStiffness], volumes: Sequence[float]) -> str:
    share = np.array(volumes) / np.sum(volumes)
    G = np.array([region.G for region in regions])
    return f"{three_figures(1.0 / float((share / G).sum()))} to {three_figures(float((share * G).sum()))}"


def _cc(volume: float | None) -> str:
    return _DASH if volume is None else f"{volume:.1f} cc"
