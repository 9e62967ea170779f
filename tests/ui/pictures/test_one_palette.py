"""One palette of labels and one kPa scale: pictures, window, files for other programs and 3D Slicer say the same by a colour."""

from __future__ import annotations

import colorsys
import re
from pathlib import Path

import numpy as np
import pytest
from phantoms import result, write_case

from palpate.imaging.labels import BLADDER, BONE, LABEL_COLOURS, LABELS, ORGAN_LABELS, RECTUM
from palpate.ui.desktop.session.display import SCALES, Display
from palpate.ui.export.nrrd import COUNT, colour_table, export
from palpate.ui.pictures.colours import OUTLINES, STIFFNESS_SCALE, StiffnessScale, label_hex, label_rgb, region_hex
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.slices import stiffness_planes
from palpate.ui.pictures.solids import AROUND

ROOT = Path(__file__).resolve().parents[3]


def test_a_label_has_one_colour_as_outline_in_3d_and_as_line() -> None:
    for label in (BLADDER, RECTUM, BONE):
        rgb = tuple(channel / 255.0 for channel in LABEL_COLOURS[label][:3])
        assert OUTLINES[label] == label_hex(label) == region_hex(LABELS[label])
        assert AROUND[LABELS[label]][:3] == label_rgb(label) == pytest.approx(rgb)
    assert {OUTLINES[label] for label in ORGAN_LABELS} == {"#ffffff"}, "what the organ is filled with has the meaning"


def test_colours_of_organs_are_told_apart_without_red_and_green() -> None:
    """As a protanope and a deuteranope see them: by the share of each cone that is left, and by lightness."""
    for lost in (0, 1):
        left = {label: np.delete(_cones(label), lost) for label in (*ORGAN_LABELS, BLADDER, RECTUM)}
        pairs = [(a, b) for a in left for b in left if a < b]
        assert min(float(np.abs(left[a] - left[b]).max()) for a, b in pairs) > 0.1


def _cones(label: int) -> np.ndarray:
    """Response of long, middle and short cones, 0 to 1 (Smith and Pokorny, after Vienot, Brettel and Mollon 1999)."""
    linear = np.array(label_rgb(label)) ** 2.2
    return np.array([[17.88, 43.52, 4.12], [3.46, 27.16, 3.87], [0.03, 0.18, 1.47]]) @ linear / [65.52, 34.49, 1.68]


def test_no_other_module_makes_up_a_colour_of_a_label_or_a_kpa_map() -> None:
    """A map of colours by its name, or the old colours of labels, in one module only."""
    allowed = {"ui/pictures/colours.py"}
    for path in [
        *(ROOT / "ui").rglob("*.py"),
        *(ROOT / "applications").rglob("*.py"),
        *(ROOT / "plugin").rglob("*.py"),
    ]:
        if str(path.relative_to(ROOT)) not in allowed:
            assert not re.search(r"\"viridis\"|RdBu|0x31, 0x68|#31688e\", \"o|0\.267, 0\.005", path.read_text()), path


def test_a_stiffness_has_one_colour_for_every_patient_in_window_report_and_slicer(tmp_path: Path) -> None:
    """A soft and a hard prostate: what is 40 kPa looks the same in both, wherever it is shown."""
    tables, painted = set(), set()
    for number, kpa in enumerate(((40.0, 12.0), (40.0, 300.0))):
        case = write_case(tmp_path / f"case_{number}", result(*kpa), ct=True)
        export(case, tmp_path / f"out_{number}")
        tables.add((tmp_path / f"out_{number}" / "stiffness_kpa.ctbl").read_text())
        figure = stiffness_planes(CaseImages(case.labels("rest"), stiffness_kpa=dict(enumerate(kpa, 1))))
        scales = {(image.norm.vmin, image.norm.vmax, image.cmap.name) for image in figure.axes[3].images[1:]}
        painted |= scales | {(*np.round(figure.axes[6].get_ylim(), 9), STIFFNESS_SCALE.colours)}
    assert tables == {colour_table(STIFFNESS_SCALE)} and painted == {(5.0, 200.0, "viridis")}
    assert SCALES[Display().scale] == STIFFNESS_SCALE
    assert Display.from_dict({"scale": "this case"}).scale == Display().scale, "of an earlier version"


@pytest.mark.parametrize("scale", [StiffnessScale(0.0, 65.0), StiffnessScale(4.0, 500.0, True)], ids=["linear", "log"])
def test_the_table_for_slicer_holds_the_scale(scale: StiffnessScale) -> None:
    rows = [line.split() for line in colour_table(scale).splitlines() if not line.startswith("#")]
    assert len(rows) == COUNT and [int(row[0]) for row in rows] == list(range(COUNT))
    for row, kpa in zip(rows, np.linspace(scale.low, scale.high, COUNT), strict=True):
        assert [int(c) for c in row[2:5]] == [round(255 * c) for c in scale.rgb(float(kpa))]
        assert float(row[1].removesuffix("_kPa")) == pytest.approx(kpa, rel=1e-3, abs=1e-3)
    hue = [colorsys.rgb_to_hsv(*(int(c) / 255 for c in row[2:5]))[0] for row in (rows[0], rows[-1])]
    assert hue[0] > 0.7 and hue[1] < 0.2, "purple is soft, yellow is hard"
