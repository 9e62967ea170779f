"""The report's section on the quality of the input: labels, alignment, mesh, and what was noted."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import cast

from palpate.case.step_records import OrganRecord, SegmentationRecord
from palpate.imaging.labels import LABELS, SURROUNDING_TISSUE
from palpate.ui.report.document import Block, Bullets, Paragraph, Section, Table
from palpate.ui.report.record import CaseRecord
from palpate.ui.report.regions import in_words, region_words
from palpate.ui.words.label_words import CARRIED, PROPAGATED, WORDS

# From its first separator to the word after its last one, spaces included.
_ABSOLUTE_PATH = re.compile(r"(?<![\w/])(?:[A-Za-z]:)?[/\\](?:[^:;,\n]*[/\\])?[^\s:;,]*")
_REGION_NOTE = (
    "Volumes are those of the voxels in the label volumes. "
    "The volume of bone is that inside the region around the prostate that is modelled; in the deformed scan that region is wider, "
    "so that nothing leaves it."
)
_CARRIED_NOTE = (
    f"\N{LEFT DOUBLE QUOTATION MARK}{CARRIED}\N{RIGHT DOUBLE QUOTATION MARK}: the search in the deformed scan begins near the place "
    "where the organ's centre lies at rest (to within 8 mm, one standard deviation). Size and outline are not carried over: they are "
    "drawn on the deformed CT's own edges as on the other scan, so that the difference between the two outlines is measured. Where "
    "either CT shows no edge, a usual prostate's shape stands in; the confidence falls with the share of such places."
)
_PROPAGATED_NOTE = (
    f"\N{LEFT DOUBLE QUOTATION MARK}{PROPAGATED}\N{RIGHT DOUBLE QUOTATION MARK}: nobody drew this organ in that scan. "
    "Its contour is the one of the other scan, moved as the tissue moves that both CTs show. Both outlines come from one contour: what "
    "it errs by is in both. What is left is the error of the motion, which the result counts by place."
)
_DASH = "\N{EN DASH}"
# By state and label.
Volumes = Mapping[str, Mapping[str, float]]


def quality(record: CaseRecord, missing: Sequence[str], exported_cc: Volumes | None = None) -> Section:
    """The section. missing : what could not be drawn and why, one line each. exported_cc : volumes on the voxels of the CT,
    cc, by state and label.
    """
    blocks: list[Block] = [Table(("label", "rest, cc", "deformed, cc", "where from"), _label_rows(record))]
    if record.segmentation:
        blocks.append(Paragraph(_REGION_NOTE, "small"))
    blocks += _exported(exported_cc or {})
    if any(CARRIED in row[-1] for row in _label_rows(record)):
        blocks.append(Paragraph(_CARRIED_NOTE))
    if any(PROPAGATED in row[-1] for row in _label_rows(record)):
        blocks.append(Paragraph(_PROPAGATED_NOTE))
    blocks += _alignment(record) + _mesh(record)
    notes = [*record.imported.get("notes", ()), *record.segmentation.get("notes", ())]
    notes += [*record.alignment.get("notes", ()), *record.result.notes]
    if notes:
        blocks.append(
            Bullets([without_paths(in_words(str(note), record.result.parameters)) for note in dict.fromkeys(notes)])
        )
    blocks += [Paragraph(f"Left out: {reason}.", "small") for reason in missing]
    return Section("Quality of the input", blocks)


def _exported(volumes: Volumes) -> list[Block]:
    """What the exports of a case measure: they hold its labels on the voxels of the CT."""
    told = []
    for value, name in LABELS.items():
        each = [f"{state[name]:.1f}" for state in volumes.values() if name in state]
        if each and value != SURROUNDING_TISSUE:
            told.append(f"{region_words(name)} {' and '.join(each)} cc")
    if not told:
        return []
    return [
        Paragraph(
            f"On the voxels of the CT, as exports have them ({' and '.join(volumes)}): {'; '.join(told)}.", "small"
        )
    ]


def _label_rows(record: CaseRecord) -> list[tuple[str, ...]]:
    rows = []
    for value, name in LABELS.items():
        if value == SURROUNDING_TISSUE:
            continue  # what is left within the box: its volume says nothing
        volumes = [record.volumes_cc.get(state, {}).get(name) for state in ("rest", "deformed")]
        if any(v is not None for v in volumes):
            rows.append((region_words(name), *(_cc(v) for v in volumes), _origin(record.segmentation, name)))
    return rows


def _origin(segmentation: SegmentationRecord, name: str) -> str:
    """How a label came about and how sure that is, as segmentation.json says of both states."""
    organ = "prostate" if name.startswith("prostate") else name
    texts = {}
    for name_of_state, state in segmentation.get("states", {}).items():
        entry = state.get("organs", {}).get(organ) or cast("Mapping[str, OrganRecord]", state).get(organ)
        if entry is None and "organs" in state:
            texts[name_of_state] = "what is left within the body"
        elif entry is not None:
            sure = None if entry["method"] == "user" else entry.get("confidence")
            said = WORDS.get(entry["method"], str(entry["method"]))
            texts[name_of_state] = said + ("" if sure is None else f", confidence {sure:.2f}")
    if len(set(texts.values())) > 1:
        return "; ".join(f"{state}: {text}" for state, text in texts.items())
    return next(iter(texts.values()), "given with the case")


def _alignment(record: CaseRecord) -> list[Block]:
    # What the import has told at the console already; the other file rounds at another digit.
    residual = record.imported.get("residual_mm", record.alignment.get("residual_mm"))
    if residual is None:
        return [Paragraph("The two states were taken as lying in one frame already; no alignment on bone was made.")]
    parts = record.alignment.get("part_residual_mm", {})
    detail = ", ".join(f"{part} {value:.2f} mm" for part, value in parts.items())
    how = "by a DICOM registration, bones agree to" if "aligned_by" in record.imported else "on bone:"
    return [Paragraph(f"Alignment {how} {residual:.2f} mm rms" + (f" ({detail})." if detail else "."))]


def _mesh(record: CaseRecord) -> list[Block]:
    mesh = record.mesh
    if not mesh:
        return []
    text = f"Mesh: {mesh['cells']} tetrahedra, {mesh['points']} points"
    if "min_dihedral_deg" in mesh:
        text += f", smallest dihedral angle {mesh['min_dihedral_deg']:.0f}\N{DEGREE SIGN}"
    organ = mesh.get("surfaces", {}).get("organ", {})
    if "p95_mm" in organ:
        text += f"; organ surface within {organ['p95_mm']:.2f} mm of the contours (95 %)"
    return [Paragraph(text + ".")]


def without_paths(text: str) -> str:
    """The text with absolute paths left out: a folder's name may hold a patient's."""
    return _ABSOLUTE_PATH.sub("(path)", text)


def _cc(value: float | None) -> str:
    return _DASH if value is None else f"{value:.1f}"
