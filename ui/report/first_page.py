"""What a clinician reads in a minute: what was scanned, what was found and how sure it is, published values, what is missing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.case.case_folder import STATES
from palpate.ui.report.diagnosis_words import gap_is_seen
from palpate.ui.report.document import Block, Bullets, Paragraph, Table
from palpate.ui.report.record import CaseRecord
from palpate.ui.report.regions import RegionStiffness
from palpate.ui.report.summary import MISFIT_TOLERANCE
from palpate.ui.words.number_words import three_figures

_DASH = "\N{EN DASH}"
# Words for how sure a value is, by the factor that its 95 % interval reaches on both sides. A convention of this report.
SURE = ((1.25, "high"), (1.5, "moderate"))
LOW, NONE = "low", "none"
SURE_RULE = (
    "How sure: by the factor that the 95 % interval reaches to both sides. high: up to 1.25; moderate: up to 1.5; low: more; none: the "
    "scans cannot determine it. One word lower where the model misses the deformed surface by more than the contours' own error. "
    "Whole prostate: between which its average lies, whatever the arrangement of its halves."
)
# Young's moduli or shear moduli as their authors give them, what was measured, how, and where that is said.
PUBLISHED = (
    ("benign cores", "E 42.3 kPa", 42.3 / 3.0, "shear wave ultrasound, 504 cores", "doi:10.1177/03915603231167650"),
    ("malignant cores", "E 71.1 kPa", 71.1 / 3.0, "shear wave ultrasound, 504 cores", "doi:10.1177/03915603231167650"),
    ("cancer", "E 58.0 kPa (30 to 110)", 58.0 / 3.0, "shear wave ultrasound, 53 patients", "PMID 22357224"),
    ("no cancer in a suspicious area", "E 30.8 kPa", 30.8 / 3.0, "3D shear wave ultrasound, 12 patients", "doi:10.3892/br.2018.1059"),
    ("cancer in a suspicious area", "E 64.1 kPa", 64.1 / 3.0, "3D shear wave ultrasound, 12 patients", "doi:10.3892/br.2018.1059"),
    ("whole gland, hyperplasia", "shear 4.40 kPa", 4.40, "MR elastography, 10 patients", "doi:10.1186/s43055-021-00679-8"),
)  # fmt: skip
PUBLISHED_NOTE = (
    "Published stiffness of the prostate. E is Young's modulus, a third of which is G. Methods differ by more than tissues do: compare "
    "within one method. Nothing here was measured as in this report, whose kPa are relative to an assumed tissue."
)


def scanned(record: CaseRecord) -> Table | None:
    """What was scanned: date, scanner, slices and voxels of both scans; None where the case came without a CT."""
    rows = []
    for state in STATES:
        scan = record.scans.get(state)
        if scan is not None:
            voxel = " \N{MULTIPLICATION SIGN} ".join(f"{edge:.3g}" for edge in scan.voxel_mm)
            rows.append((state, scan.date or _DASH, scan.scanner or _DASH, str(scan.slices), f"{voxel} mm"))
    return Table(("scan", "date", "scanner", "slices", "voxel"), rows, numbers=False) if rows else None


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
        told = all(region.told for region in record.regions) and len(halves) == len(record.regions)
        rows.append(
            ("whole prostate", _cc(sum(halves)), _between(record.regions, halves) if told else _DASH, _DASH, "")
        )
    return Table(("region", "volume at rest", "G, kPa", "95 % interval, kPa", "how sure"), rows, numbers=False)


def how_sure(region: RegionStiffness, record: CaseRecord) -> str:
    """ "high", "moderate", "low" or "none", by `SURE_RULE`."""
    if not region.told:
        return NONE
    factor = np.inf if region.ln_sd is None else float(np.exp(1.96 * region.ln_sd))
    words = [word for _, word in SURE] + [LOW]
    place = next((k for k, (most, _) in enumerate(SURE) if factor <= most), len(SURE))
    return words[min(place + _misses(record), len(SURE))]


def _misses(record: CaseRecord) -> bool:
    """Whether the model misses the surface by more than the contours' own error, by the misfit or the diagnosis."""
    expected = record.expected_misfit_mm
    large = expected is not None and record.result.misfit.rms_mm > MISFIT_TOLERANCE * expected
    return large or gap_is_seen(record.diagnosis)


def missing(record: CaseRecord) -> list[str]:
    """What would have to be there for a better answer, one line each."""
    lines = []
    if record.diagnosis is None:
        lines.append("whether the model leaves something out: Diagnose has not been run")
    if record.noise_from.startswith("assumed"):
        lines.append("how repeatable the contours are: assumed; draw them twice and it is measured")
    if record.noise_from.startswith("estimated"):
        lines.append(
            "how repeatable the contours are: estimated from the images; draw them by hand twice and it is measured"
        )
    methods = {
        organ.get("method")
        for state in record.segmentation.get("states", {}).values()
        for organ in state.get("organs", {}).values()
    }
    if methods and "user" not in methods:
        lines.append("contours that a person has drawn or checked: these were found automatically")
    return [*lines, "stiffness in absolute terms: it would need a force that is known"]


def minute(record: CaseRecord) -> list[Block]:
    """The tables of the first page, after its sentences."""
    scans = scanned(record)
    told: list[Block] = [] if scans is None else [scans]
    told += [found(record), Paragraph(SURE_RULE, "small"), Paragraph("What is missing:"), Bullets(missing(record))]
    return told


def published() -> list[Block]:
    """What others have measured, with where they say so."""
    rows = [(what, said, f"{G:.3g}", how, source) for what, said, G, how, source in PUBLISHED]
    return [Table(("tissue", "as given", "G, kPa", "how", "source"), rows, PUBLISHED_NOTE, numbers=False)]


def _value(region: RegionStiffness) -> tuple[str, str]:
    if not region.told:
        return _DASH, _DASH
    interval = _DASH if region.ci is None else f"{three_figures(region.ci[0])} to {three_figures(region.ci[1])}"
    return three_figures(region.G), interval


def _between(regions: Sequence[RegionStiffness], volumes: Sequence[float]) -> str:
    share = np.array(volumes) / np.sum(volumes)
    G = np.array([region.G for region in regions])
    return f"{three_figures(1.0 / float((share / G).sum()))} to {three_figures(float((share * G).sum()))}"


def _cc(volume: float | None) -> str:
    return _DASH if volume is None else f"{volume:.1f} cc"
