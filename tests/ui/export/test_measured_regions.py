"""A region that a person drew on the map: the report's table and the SR say the same, the SR with its outline in the patient."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pydicom
import pytest
from highdicom import sr
from map_arrays import map_arrays
from phantoms import CENTRE, map_facts, result, write_case

from palpate.case.case_folder import CaseFolder
from palpate.case.measured.measurements import Measurement, write_measurements
from palpate.ui.export import exporter
from palpate.ui.report.declaration import REPORT
from palpate.ui.report.document import Table
from palpate.ui.report.figures import Figures
from palpate.ui.report.measured_regions import measured_table
from palpate.ui.report.record import read_record
from palpate.ui.report.stiffness_section import stiffness_section

OUTLINE = tuple(
    (float(CENTRE[0] + x), float(CENTRE[1] + y), float(CENTRE[2])) for x, y in ((4, -5), (14, -5), (14, 5), (4, 5))
)


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> CaseFolder:
    made = write_case(tmp_path_factory.mktemp("measured") / "case", result(stiffness_map=map_facts()), ct=True)
    made.write_npz("identify/stiffness_map.npz", **map_arrays(True))
    distance = Measurement("B", "distance", "axial", OUTLINE[:2])
    write_measurements(made, (Measurement("A", "region", "axial", OUTLINE), distance))
    return made


def test_the_report_has_one_small_table(case: CaseFolder) -> None:
    record = read_record(case, {"rest": case.labels("rest")})
    (table,) = measured_table(record.measured)
    assert isinstance(table, Table) and len(table.rows) == 1, "distances are no regions"
    name, where, area, G, interval, E, told = table.rows[0]
    assert name == "A (region)" and where.startswith("axial, z = ") and area == "100" and told == "100 %"
    assert float(E) == pytest.approx(3.0 * float(G), rel=0.01)
    low, high = (float(word) for word in interval.split(" to "))
    assert low < float(G) < high and float(G) == pytest.approx(20.0, abs=0.05), "the soft half's patch alone"
    assert measured_table(()) == []


def test_the_report_has_what_was_measured_with_ruler_and_angle(tmp_path: Path) -> None:
    made = write_case(tmp_path / "case", result(), ct=True)
    x, y, z = (float(c) for c in CENTRE)
    lines = (
        Measurement("A", "distance", "axial", ((x, y, z), (x + 3.0, y + 4.0, z))),
        Measurement("B", "angle", "coronal", ((x, y, z), (x + 9.0, y, z), (x + 9.0, y, z + 9.0))),
    )
    write_measurements(made, lines)
    record = read_record(made, {"rest": made.labels("rest")})
    tables = [b for b in stiffness_section(record, Figures()).blocks if isinstance(b, Table)]
    assert tables[-1].rows == [
        ("A (distance)", f"axial, z = {z:.1f} mm".replace("-", "\N{MINUS SIGN}"), "5.0 mm"),
        ("B (angle)", f"coronal, y = {y:.1f} mm".replace("-", "\N{MINUS SIGN}"), "90.0\N{DEGREE SIGN}"),
    ]


def test_the_report_is_out_of_date_when_a_region_is_drawn(case: CaseFolder) -> None:
    before = REPORT.made_from(case, {})
    kept = case.file("measurements.json").read_text()
    write_measurements(case, ())
    assert REPORT.made_from(case, {}) != before
    case.write_text("measurements.json", kept)


def test_the_sr_has_outline_area_mean_and_interval(case: CaseFolder, tmp_path: Path) -> None:
    files = exporter("dicom-sr").export(case, tmp_path)
    path = next(path for path in files if path.name == "measurements_sr.dcm")
    found = sr.srread(path)
    groups = found.content.get_planar_roi_measurement_groups()
    assert len(groups) == 1 and len(found.content.get_volumetric_roi_measurement_groups()) == 2
    said = {(m.name.meaning, m.unit.value): m.value for m in groups[0].get_measurements()}
    (region,) = read_record(case, {"rest": case.labels("rest")}).measured
    assert said["Area", "mm2"] == pytest.approx(100.0)
    assert said["Small-strain shear modulus G", "kPa"] == pytest.approx(region.mean.G_kpa, rel=1e-3)
    assert region.mean.interval_kpa is not None
    assert said["Upper limit of the 95 % interval", "kPa"] == pytest.approx(region.mean.interval_kpa[1], rel=1e-3)
    outline = np.array(groups[0].roi.value)
    assert np.allclose(outline[:4], OUTLINE) and np.allclose(outline[-1], OUTLINE[0])
    assert pydicom.dcmread(path).SOPClassUID == "1.2.840.10008.5.1.4.1.1.88.34", "the SR for outlines in space"
    if shutil.which("dciodvfy"):
        judged = subprocess.run(["dciodvfy", str(path)], capture_output=True, text=True, check=False)
        assert not [line for line in judged.stderr.splitlines() if line.startswith("Error")], judged.stderr
