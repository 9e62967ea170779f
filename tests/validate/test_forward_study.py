"""The element study in short: 480 cells against 3,840. The full table: `palpate validate forward`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from palpate.core.fem.elements import DEFAULT_ELEMENT
from palpate.core.fem.meshes import ORGAN, TISSUE, refined, sphere_in_cube
from palpate.core.fem.scenes import DRIVES, sphere_scene, standard_sphere_mesh
from palpate.ui.cli.commands.validate import STUDIES
from palpate.ui.pictures.element_errors import element_errors
from palpate.validate.bench.options import BenchOptions
from palpate.validate.forward.study import ForwardOptions, forward, reference_rms, seconds_to
from palpate.validate.forward.study import element_errors as errors_of


@pytest.mark.parametrize("drive", DRIVES)
def test_the_default_element_does_not_lock(drive: str) -> None:
    """Its error is small and the same whatever the bulk modulus; the paper's element is several times worse."""
    mesh = sphere_in_cube(2, 1, 2)
    fine = refined(mesh)
    found = {}
    for ratio in (50.0, 1000.0):
        for row in errors_of([mesh], fine, ratio, drive, ("p1", DEFAULT_ELEMENT), 1):
            assert row["converged"] and row["reference_converged"]
            found[row["element"], ratio] = float(row["rms"])
    assert found[DEFAULT_ELEMENT, 1000.0] < 0.035
    assert found[DEFAULT_ELEMENT, 1000.0] < 1.1 * found[DEFAULT_ELEMENT, 50.0]
    assert found["p1", 1000.0] > 5.0 * found[DEFAULT_ELEMENT, 1000.0]


def test_the_study_gives_a_row_for_every_case() -> None:
    small = replace(BenchOptions(quick=True).effective(), reduced_divisions=(1, 1, 1), unseen=10)
    options = ForwardOptions(80, (50.0,), elements=("p1", "p1p1"), repeats=1, levels=1, reduced=small)
    found = forward(options)
    assert found["reduced_model"]["largest_error_percent"] <= 0.1  # type: ignore[index]
    rows = found["rows"]
    assert isinstance(rows, list) and len(rows) == 4
    told = STUDIES["forward"].text(found).splitlines()
    assert sum(line.startswith(DRIVES) for line in told) == 4 and any("reduced model" in line for line in told)
    assert {(r["drive"], r["element"]) for r in rows} == {(d, e) for d in DRIVES for e in ("p1", "p1p1")}
    assert all(0.0 < r["rms"] < r["largest"] < 1.0 and r["seconds"] > 0.0 for r in rows)


def test_the_references_own_error_is_read_off_two_coarser_meshes() -> None:
    true = np.array([0.08, 0.02, 0.005])
    assert reference_rms(list(true[:2] - true[2])) == pytest.approx(true[2])
    assert np.isnan(reference_rms([0.1]))


def test_the_picture_shows_every_element() -> None:
    row = {"ratio": 50.0, "drive": "traction", "cells": 80, "rms": 0.02, "cpu_seconds": 0.1}
    rows = [{**row, "element": e, "ratio": r} for e in ("p1", "p2p1") for r in (50.0, 1000.0)]
    figure = element_errors({"rows": rows, "sizes": rows})
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["p1", "p2p1"]
    assert len(figure.axes) == 2


def test_time_to_an_error_is_read_off_in_logarithms() -> None:
    rows = [{"rms": 0.08, "cpu_seconds": 1.0}, {"rms": 0.02, "cpu_seconds": 10.0}]
    assert seconds_to(0.01, rows) == pytest.approx(10.0**1.5)
    assert seconds_to(0.01, rows[:1]) is None
    assert seconds_to(0.003, rows) is None  # too far from what was measured


def test_the_load_on_the_sphere_has_no_net_force_and_does_not_depend_on_refinement() -> None:
    mesh = sphere_in_cube(2, 1, 2)
    totals = []
    for m in (mesh, refined(mesh)):
        load = sphere_scene(m, "p2p1").assembler.terms[0]
        assert np.abs(load.force.sum(axis=0)).max() < 1e-9 * np.abs(load.force).sum()  # type: ignore[attr-defined]
        totals.append(np.abs(load.force).sum())  # type: ignore[attr-defined]
    assert totals[0] == pytest.approx(totals[1], rel=0.02)


def test_the_standard_mesh_is_a_ball_in_a_cube() -> None:
    mesh = standard_sphere_mesh(4000)
    assert abs(len(mesh.cells) - 4000) < 400
    assert mesh.volumes.sum() == pytest.approx(50.0**3, rel=1e-12)
    ball = 4.0 / 3.0 * np.pi * 1000.0
    assert mesh.volumes[mesh.regions == ORGAN].sum() == pytest.approx(ball, rel=0.08)
    surface = np.unique(mesh.region_boundary((ORGAN,))[0])
    np.testing.assert_allclose(np.linalg.norm(mesh.points[surface], axis=1), 10.0, rtol=1e-12)
    assert set(np.unique(mesh.regions)) == {ORGAN, TISSUE}
