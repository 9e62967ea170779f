"""A body on a bench as case.json states it: patches, axes that are not seen, forces; and one line for what is wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import pyvista as pv
from bench_case import DISC, FLOOR, ROWS, facts, write

from palpate.case.bench.body import body_problem
from palpate.case.case_facts import OTHER_KEYS
from palpate.case.case_folder import CaseFolder
from palpate.case.stated_files import BenchBody
from palpate.core.errors import InputError

MOVED = facts()["states"][0]["moved"][0]


@pytest.fixture(scope="module")
def meshed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A case whose mesh is made."""
    folder = write(tmp_path_factory.mktemp("bench") / "case", facts())
    body_problem(CaseFolder(folder))
    return folder


def test_patches_axes_and_forces_are_read(meshed: Path) -> None:
    write(meshed, facts())
    problem = body_problem(CaseFolder(meshed))
    state, disc = problem.states[0], problem.patches[0]
    assert state.sd_mm == (0.1, None, 0.1)
    assert all(y is None for _, y, _ in state.deformed)
    assert state.seen.sum() == 2 * len(ROWS)
    assert (disc.facts.displacement_mm, disc.facts.sd_mm, disc.facts.state) == ((0.0, 0.0, -1.0), (0.02,) * 3, 0)
    assert (disc.facts.reaction_n, disc.facts.reaction_sd_n[2]) == ((None, None, -1.1), 0.1)
    X = problem.mesh.points[disc.faces]
    np.testing.assert_allclose(X[..., 2], 20.0, atol=0.5)
    assert (np.linalg.norm(X.mean(axis=1) - [15.0, 12.0, 20.0], axis=1) < 9.0).all()
    assert len(disc.rim) > 3
    np.testing.assert_allclose(problem.mesh.points[problem.held][..., 2], 0.0, atol=0.5)


def test_a_column_of_an_axis_that_is_not_seen_may_be_missing(meshed: Path) -> None:
    plane = ["name,rest_x,rest_y,rest_z,deformed_x,deformed_z", *(row.replace(",,", ",") for row in ROWS)]
    write(meshed, facts(), plane[1:], plane[0])
    assert body_problem(CaseFolder(meshed)).states[0].seen.sum() == 2 * len(ROWS)
    with pytest.raises(InputError, match="lacks the column deformed_y"):
        body_problem(CaseFolder(write(meshed, facts(points_sd_mm=0.1), plane[1:], plane[0])))


def test_a_marker_that_is_lost_along_an_axis_has_no_datum_there(meshed: Path) -> None:
    write(meshed, facts(), [*ROWS[1:], "lost,5,0,5,5,,"])
    assert body_problem(CaseFolder(meshed)).states[0].seen.sum() == 2 * len(ROWS) - 1


def test_a_roller_holds_along_its_axes_alone(meshed: Path) -> None:
    sides = [
        {**FLOOR, "axes": "z"},
        {"name": "side", "plane_point": [0, 0, 0], "plane_normal": [1, 0, 0], "axes": "xy"},
    ]
    problem = body_problem(CaseFolder(write(meshed, {**facts(), "supports": sides})))
    assert len(problem.held) == 0
    assert [p.facts.displacement_mm for p in problem.patches[:2]] == [(None, None, 0.0), (0.0, 0.0, None)]


def test_another_number_of_cells_makes_another_mesh(tmp_path: Path) -> None:
    case = CaseFolder(write(tmp_path / "case", {**facts(), "cells": 60}))
    few = len(body_problem(case).mesh.cells)
    assert len(body_problem(CaseFolder(write(tmp_path / "case", {**facts(), "cells": 600}))).mesh.cells) > 2 * few


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"points_sd_mm": [0.1, 0.1]}, r"states\[0\].points_sd_mm is .*3 numbers of which some may be null"),
    ({"points_sd_mm": -0.1}, r"points_sd_mm of the state 'pressed' is -0.1; it must be a number above 0"),
    ({"points_sd_mm": [None, None, None], "moved": []}, r"shows no marker's motion along any axis"),
    ({"moved": [{**DISC}]}, r"has no states\[0\].moved\[0\].displacement_mm"),
    ({"moved": [{**DISC, "displacement_mm": [None] * 3}]}, r"moved\[0\]: displacement_mm prescribes nothing"),
    ({"moved": [{"displacement_mm": [0, 0, 1]}]}, r"moved\[0\] says not where it is"),
    (
        {"moved": [{"centre": [0, 0, 0], "displacement_mm": [0, 0, 1]}]},
        r"half of a disc; give both centre and radius_mm",
    ),
    ({"moved": [{**DISC, "radius_mm": 0.01, "displacement_mm": [0, 0, 1]}]}, r"on no face of the body, .* mm wide"),
    ({"load": []}, r"states\[0\].load is unknown; allowed are name, points"),
    ({"loads": [{"at": [0, 0, 20], "force_n": [0, 0, -1], "force": 1}]}, r"states\[0\].loads\[0\].force is unknown"),
    ({"moved": [{**MOVED, "plane_pont": [0, 0, 20]}]}, r"states\[0\].moved\[0\].plane_pont is unknown"),
    ({"moved": [{**MOVED, "plane_normal": [0, 0, 0]}]}, r"moved\[0\]: plane_normal is \[.*\] and has no length"),
    ({"gravity": [0, 0, -981]}, r"states\[0\]\.gravity is .*-981.*; it must be three numbers in m/s\^2"),
    ({"gravity": [0, 15, -15]}, r"states\[0\]: gravity is .*-15.*; it must be three numbers in m/s\^2"),
    (
        {"moved": [{**MOVED, "plane_point": [0, 0, 0], "centre": [15, 12, 0]}]},
        r"faces lie in the support or patch 'that holds along all axes' and in 'disc', which prescribe 0 mm and -1 mm along z",
    ),
    ({"moved": [{**MOVED, "reaction_sd_n": None}]}, r"a force along z without an error; give reaction_sd_n"),
    ({"moved": [{**MOVED, "displacement_mm": [0, 0, None]}]}, r"a force along z, where the patch is free"),
]


@pytest.mark.parametrize(("state", "line"), WRONG)
def test_what_is_wrong_is_said_in_one_line(meshed: Path, state: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError, match=line) as raised:
        body_problem(CaseFolder(write(meshed, facts(**state))))
    assert "\n" not in str(raised.value)


def test_a_body_that_can_move_as_a_whole_is_refused_with_what_it_can_do(meshed: Path) -> None:
    stated = {**facts(moved=[]), "supports": [{**FLOOR, "axes": "z"}]}
    with pytest.raises(
        InputError, match=r"in the state 'pressed' the body can (slide along|turn about) [xyz]: nothing holds"
    ):
        body_problem(CaseFolder(write(meshed, stated)))


@pytest.mark.parametrize("density", [1.07, 1.07e-9, 1e5])
def test_a_density_in_another_unit_is_refused(meshed: Path, density: float) -> None:
    with pytest.raises(InputError, match=r"density_kg_m3 is .*; it must be a density in kg/m3 from 10 to 25000"):
        body_problem(CaseFolder(write(meshed, {**facts(), "density_kg_m3": density})))


def test_a_misspelt_key_of_the_case_is_refused_and_remarks_are_kept(meshed: Path) -> None:
    with pytest.raises(InputError, match=r"densty_kg_m3 is unknown; is 'density_kg_m3' meant\?"):
        CaseFolder(write(meshed, {**facts(), "densty_kg_m3": 1000.0}))
    assert CaseFolder(write(meshed, {**facts(), "notes": ["warm"]})).facts.other["notes"] == ["warm"]
    assert {f.name for f in msgspec.structs.fields(BenchBody)} <= set(OTHER_KEYS)


def test_a_volume_mesh_is_no_body(tmp_path: Path) -> None:
    folder = write(tmp_path / "case", {**facts(), "body": "body.vtu"})
    pv.read(folder / "body.stl").delaunay_3d().save(folder / "body.vtu")
    with pytest.raises(
        InputError, match=r"body\.vtu is no STL, OBJ or PLY file; save the surface in one of these forms"
    ):
        body_problem(CaseFolder(folder))
