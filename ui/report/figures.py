"""The pictures of a report: drawn from the files of a case, each with its caption."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from palpate.case.case_folder import CaseFolder
from palpate.case.identified import map_arrays
from palpate.case.meshed import ORGAN_NAME, load_surfaces
from palpate.core.arrays import FloatArray
from palpate.core.worker.progress import Progress
from palpate.imaging.volume import Volume
from palpate.ui.pictures import slices, solids
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.map_planes import Arrays, map_planes
from palpate.ui.pictures.offscreen import OffscreenError, polydata
from palpate.ui.pictures.published_scale import published_scale
from palpate.ui.pictures.solids import MisfitMap
from palpate.ui.report.document import Interactive, Picture
from palpate.ui.report.first_page import scale_caption, scale_rows
from palpate.ui.report.gap_section import gap_pictures
from palpate.ui.report.map_words import map_caption
from palpate.ui.report.motion_section import motion_pictures
from palpate.ui.report.moving import moving_view
from palpate.ui.report.record import CaseRecord
from palpate.ui.report.summary import tells_apart
from palpate.ui.words.number_words import three_figures

_PLANES_CAPTION = (
    "Slices through the organ ({ground}). Above, dotted lines show where the other slices lie; below, the shear modulus "
    "in colour; hatched or grey where this pair does not determine it. The sagittal slice goes through the region of the highest value. "
    "R right, L left, A anterior, P posterior, S superior, I inferior of the patient; positions in DICOM coordinates (LPS).{bar}{doubt}"
)


_ANATOMY_CAPTION = (
    "The organ at rest coloured by shear modulus; bones (ivory), bladder (yellow) and rectum (purple) translucent, cut off where the "
    "region that is modelled ends."
)
_MISFIT_CAPTION = (
    "Where the model's deformed organ lies outside (red) or inside (blue) the surface that the deformed scan shows. "
    "The table above has its rms and its 95 % over the same points. Black lines in the colour bar: what the contours' own error "
    "would leave (one standard deviation)."
)
# Points lie some two millimetres apart: a mean over about that shows every patch of theirs and no facets.
_NEAREST, _REACH_MM = 16, 2.0


@dataclass(frozen=True)
class Figures:
    """pictures : by name. missing : what could not be drawn and why, one line each.

    interactive : the view that turns and plays the deformation; empty before identification.
    """

    pictures: dict[str, Picture] = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)
    interactive: list[Interactive] = field(default_factory=list)

    def add(self, name: str, folder: Path, figure: Figure, caption: str, says: str, width: float = 1.0) -> None:
        """Saves a figure as folder/name.png."""
        path = slices.save(figure, folder / f"{name}.png")
        self.pictures[name] = Picture(path, caption, says, width, slices.as_pdf(figure))


def draw(
    case: CaseFolder, record: CaseRecord, labels: Mapping[str, Volume], folder: Path, progress: Progress
) -> Figures:
    """All pictures of a case, as PNG files in ``folder``. What this machine cannot draw is listed, not an error."""
    mapped = map_arrays(case, record.result)
    images = _images(case, record, labels)
    figures = Figures()
    progress(0.0, "scenes in three dimensions")
    anatomy = _anatomy(case, images) if case.has("surfaces.npz") else None
    misfit = _misfit(case, record) if case.has("surfaces.npz") and case.has("identify/fields.npz") else None
    _published(figures, record, folder)
    progress(0.1, "slices")
    _slices(figures, images, folder, not tells_apart(record))
    if mapped is not None:
        _map(figures, mapped, record, images, folder)
    figures.pictures.update(gap_pictures(case, images, folder))
    figures.pictures.update(motion_pictures(case, images, folder))
    if anatomy is not None:
        progress(0.6, "three dimensions")
        says = "Two three-dimensional views of the organ among its neighbours."
        _add_or_missing(figures, "anatomy", folder, anatomy, _ANATOMY_CAPTION, says, "the 3D view")
    if misfit is not None:
        progress(0.8, "misfit on the organ")
        says = "Four views of the organ coloured by signed distance in mm."
        _add_or_missing(figures, "misfit", folder, misfit, _MISFIT_CAPTION, says, "the misfit on the organ")
    if case.has("mesh.npz") and case.has("identify/fields.npz"):
        figures.interactive.append(moving_view(case, images))
    return figures


def _published(figures: Figures, record: CaseRecord, folder: Path) -> None:
    rows = scale_rows(record)
    values = "; ".join(f"{row.words}: {three_figures(row.G)} kPa" for row in rows)
    says = f"A scale of the shear modulus. {values}."
    figures.add("published", folder, published_scale(rows), scale_caption(rows), says)


def _images(case: CaseFolder, record: CaseRecord, labels: Mapping[str, Volume]) -> CaseImages:
    ct = case.ct("rest") if case.has("rest_ct") else None
    stiffness = {region.label: region.G for region in record.regions}
    undetermined = frozenset(region.label for region in record.regions if not region.determined)
    return CaseImages(labels["rest"], labels.get("deformed"), ct, stiffness, undetermined)


def _slices(figures: Figures, images: CaseImages, folder: Path, same: bool) -> None:
    doubt = (
        " The difference of the colours is within the error: this pair does not show which half is stiffer."
        if same
        else ""
    )
    bar = " Lines in the colour bar: the values found." if images.determined else ""
    ground = "CT at rest, W 400 L 40" if images.ct is not None else "no CT: labels at rest in grey and colour"
    told = ", ".join(f"label {label}: {three_figures(G)} kPa" for label, G in images.stiffness_kpa.items())
    says = f"Slices in three planes with the organ coloured by shear modulus ({told})."
    figures.add(
        "stiffness_planes",
        folder,
        slices.stiffness_planes(images),
        _PLANES_CAPTION.format(ground=ground, doubt=doubt, bar=bar),
        says,
    )
    caption = "Axial slices from the organ's lower to its upper end."
    figures.add("stiffness_series", folder, slices.stiffness_series(images), caption, f"Six axial slices. {says}")
    if images.deformed is not None:
        caption = (
            "Outlines at rest (solid) and deformed (dashed) on the anatomy at rest, after alignment on bone; open where the scan or "
            "the region that is modelled ends."
        )
        says = "Slices in three planes with the outlines of organ, bladder and rectum in both states."
        figures.add("deformation_planes", folder, slices.deformation_planes(images), caption, says)


def _map(figures: Figures, mapped: Arrays, record: CaseRecord, images: CaseImages, folder: Path) -> None:
    facts = record.result.stiffness_map
    assert facts is not None
    figure = map_planes(images, mapped)
    caption = map_caption(facts, record.result.parameters)
    says = "Slices in three planes with a map of the shear modulus within the organ, and how well it is known."
    figures.add("stiffness_map", folder, figure, caption, says)


def _anatomy(case: CaseFolder, images: CaseImages) -> solids.Drawn:
    return solids.anatomy(load_surfaces(case, "rest"), images.determined, images.rest)


def _misfit(case: CaseFolder, record: CaseRecord) -> solids.Drawn:
    return solids.misfit(misfit_map(case, record.expected_misfit_mm))


def _add_or_missing(
    figures: Figures, name: str, folder: Path, drawn: solids.Drawn, caption: str, says: str, what: str
) -> None:
    try:
        figures.add(name, folder, drawn(), caption, says)
    except OffscreenError as error:
        figures.missing.append(f"{what}, because {error}")


def misfit_map(case: CaseFolder, noise_mm: float | None) -> MisfitMap:
    """The organ's smooth surface moved as identified, and the signed distance from the deformed scan's surface.

    The distance is that of the points at which the surface was compared, so that a picture shows what the table says: the
    corners of the mesh lie up to two millimetres off a surface that bends between them.
    """
    fields = case.read_npz("identify/fields.npz")
    at, move = fields["surface_points"], fields["surface_displacement"]
    target = load_surfaces(case, "deformed")[ORGAN_NAME]
    seen = polydata(target.points, target.faces)
    distance = np.asarray(
        polydata(at + move, np.zeros((0, 3), dtype=np.int64)).compute_implicit_distance(seen)["implicit_distance"]
    )
    organ = load_surfaces(case, "rest")[ORGAN_NAME]
    spread = _spread(at, np.column_stack([move, distance]), organ.points)
    return MisfitMap(organ.points + spread[:, :3], organ.faces, spread[:, 3], noise_mm, float(np.abs(distance).max()))


def _spread(at: FloatArray, values: FloatArray, points: FloatArray) -> FloatArray:
    """Values (q, k) at places (q, 3) carried to points (n, 3): means of the nearest, weighed by their distance."""
    count = min(_NEAREST, len(at))
    far, near = cKDTree(at).query(points, k=range(1, count + 1))
    weight = 1.0 / (far**2 + _REACH_MM**2)
    weight /= weight.sum(axis=1, keepdims=True)
    return np.asarray((weight[:, :, None] * values[near]).sum(axis=1), dtype=np.float64)
