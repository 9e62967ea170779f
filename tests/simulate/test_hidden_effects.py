"""What a simulation hides: which cells it changes, how far that shows, and that the case does not tell."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from made_up_body import body

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.case.steps.simulate.step import run_simulate
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.mesh import TetMesh
from palpate.imaging.labels import ORGAN_LABELS, SURROUNDING_TISSUE
from palpate.meshing.mesh_labels import MeshOptions, mesh_labels
from palpate.simulate.hidden_effects import Capsule, HiddenEffect, Inclusion, SlidingOrgan, UnevenTissue, with_effects
from palpate.simulate.stiffness import Stiffness

STIFFNESS = Stiffness({1: 15.0, 2: 45.0})
WALLS = {"contact": "tied", "rectum": {"inflate_mm": -3, "push_mm": [1, 3, 0]}}


@pytest.fixture(scope="module")
def mesh() -> TetMesh:
    return mesh_labels(body(), MeshOptions(edge_mm=9.0)).mesh


def _moduli(mesh: TetMesh, hidden: tuple[HiddenEffect, ...]) -> tuple[FloatArray, FloatArray]:
    """Shear and bulk modulus of every cell, kPa."""
    G, K = np.empty(len(mesh.cells)), np.empty(len(mesh.cells))
    for region, material in with_effects(mesh, STIFFNESS.materials(), hidden).items():
        here = mesh.regions == region
        values = material.per_cell(int(here.sum()))
        G[here] = values[:, 0] if region == SURROUNDING_TISSUE else 2.0 * (values[:, 0] + values[:, 1])
        K[here] = values[:, -1] * (1.0 if region == SURROUNDING_TISSUE else 2.0)
    return G, K


def test_a_focus_lies_in_its_half_and_has_its_volume(mesh: TetMesh) -> None:
    G, K = _moduli(mesh, (Inclusion(1, (1.0, 0.0, 0.0), 8.0, 6.0),))
    plain, bulk = _moduli(mesh, ())
    stiff = plain * 3.0 < G
    assert G[stiff] == pytest.approx(90.0)
    assert K[stiff] == pytest.approx(6.0 * bulk[stiff])
    assert np.array_equal(G[~stiff], plain[~stiff])
    assert set(mesh.regions[stiff].tolist()) == {1}
    # the cells whose middle lies in the ball, so its volume to a cell's breadth
    middle = np.average(mesh.points[mesh.cells[stiff]].mean(axis=1), axis=0, weights=mesh.volumes[stiff])
    half = mesh.regions == 1
    centroid = np.average(mesh.points[mesh.cells[half]].mean(axis=1), axis=0, weights=mesh.volumes[half])
    assert middle == pytest.approx(centroid + [1.0, 0.0, 0.0], abs=2.5)
    assert 0.2 < mesh.volumes[stiff].sum() / (4.0 / 3.0 * np.pi * 8.0**3) < 1.2


def test_tissue_is_stiffer_on_its_side_only(mesh: TetMesh) -> None:
    G, _ = _moduli(mesh, (UnevenTissue((0.0, 2.0, 0.0), 3.0, 5.0),))
    organ = np.isin(mesh.regions, ORGAN_LABELS)
    centres = mesh.points[mesh.cells].mean(axis=1)
    y = np.average(centres[organ], axis=0, weights=mesh.volumes[organ])[1]
    tissue = mesh.regions == SURROUNDING_TISSUE
    assert G[tissue & (centres[:, 1] - y > 3.0)] == pytest.approx(100.0)
    assert G[tissue & (centres[:, 1] - y < 3.0)] == pytest.approx(20.0)
    assert set(G[organ]) == {15.0, 45.0}


def test_an_organ_slides_by_a_layer_all_round_it(mesh: TetMesh) -> None:
    G, K = _moduli(mesh, (SlidingOrgan(4.0, 20.0),))
    plain, bulk = _moduli(mesh, ())
    layer = 0.5 * plain > G
    assert G[layer] == pytest.approx(1.0)
    assert np.array_equal(K, bulk)
    corners = np.unique(mesh.region_boundary(ORGAN_LABELS)[0])
    distance = np.linalg.norm(
        mesh.points[mesh.cells[layer]].mean(axis=1)[:, None] - mesh.points[corners][None], axis=2
    ).min(axis=1)
    assert distance.max() < 9.0
    assert set(mesh.regions[layer].tolist()) == {SURROUNDING_TISSUE}
    middle = mesh.points[corners].mean(axis=0)
    away = mesh.points[mesh.cells[layer]].mean(axis=1) - middle
    assert {tuple(signs) for signs in (away > 0).tolist()} == {
        (x, y, z) for x in (True, False) for y in (True, False) for z in (True, False)
    }


def test_no_cell_on_a_wall_or_on_bone_is_in_the_layer_of_an_organ_that_slides(mesh: TetMesh) -> None:
    G, _ = _moduli(mesh, (SlidingOrgan(40.0, 20.0),))
    tissue = mesh.regions == SURROUNDING_TISSUE
    soft = 0.5 * _moduli(mesh, ())[0] > G
    at_edge = np.isin(mesh.cells, np.unique(mesh.boundary[0])).any(axis=1)
    assert (tissue & at_edge).sum() > 100
    assert np.array_equal(soft, tissue & ~at_edge)


def test_a_capsule_is_the_rind_of_the_organ_on_all_sides(mesh: TetMesh) -> None:
    G, K = _moduli(mesh, (Capsule(5.0, 4.0),))
    plain, bulk = _moduli(mesh, ())
    rind = 2.0 * plain < G
    assert G[rind] == pytest.approx(4.0 * plain[rind])
    assert np.where(rind, 4.0, 1.0) * bulk == pytest.approx(K)
    organ, centres = np.isin(mesh.regions, ORGAN_LABELS), mesh.points[mesh.cells].mean(axis=1)
    assert set(mesh.regions[rind].tolist()) == set(ORGAN_LABELS)
    # Nearer to the surface's corners than the thickness and a face's size; no cell so near to it is left out.
    corners = mesh.points[np.unique(mesh.region_boundary(ORGAN_LABELS)[0])]
    distance = np.linalg.norm(centres[:, None] - corners, axis=2).min(axis=1)
    assert distance[rind].max() < 5.0 + 9.0
    assert distance[organ & ~rind].min() > 5.0
    assert 0.2 < rind[organ].mean() < 0.95


def test_two_effects_multiply(mesh: TetMesh) -> None:
    one, other = UnevenTissue((0.0, 1.0, 0.0), 0.0, 5.0), SlidingOrgan(4.0, 20.0)
    both, first, second, plain = (_moduli(mesh, h)[0] for h in ((one, other), (one,), (other,), ()))
    assert both == pytest.approx(first * second / plain)


@pytest.mark.parametrize(
    ("hidden", "message"),
    [
        (Inclusion(1, (15.0, 15.0, 15.0), 3.0, 5.0), "no cell of prostate_left"),
        (UnevenTissue((0.0, 1.0, 0.0), 400.0, 5.0), "no tissue lies beyond"),
        (SlidingOrgan(0.01, 5.0), "give a larger layer_mm"),
        (Capsule(0.01, 5.0), "give a larger thickness_mm"),
    ],
)
def test_an_effect_that_meets_no_cell_is_refused(mesh: TetMesh, hidden: HiddenEffect, message: str) -> None:
    with pytest.raises(InputError, match=rf"simulation spec: hidden\..*{message}"):
        with_effects(mesh, STIFFNESS.materials(), (hidden,))


def test_the_answers_tell_what_shows_and_the_case_tells_nothing(tmp_path: Path) -> None:
    source = CaseFolder.create(tmp_path / "source", CaseFacts("made-up"))
    source.write_labels("rest", body())
    spec = {
        "source": {"case": str(source.path)},
        "stiffness_kpa": {"prostate_left": 15, "prostate_right": 45},
        "walls": WALLS,
        "mesh": {"edge_mm": 9},
        "output": "labels",
    }
    hidden = {"tissue_heterogeneity": {"towards": [0, 1, 0], "factor": 5}}
    truth = run_simulate({**spec, "hidden": hidden}, tmp_path / "pair", tmp_path / "answers")
    plain = run_simulate(spec, tmp_path / "other", tmp_path / "answers")
    assert plain["hidden"] is None
    shown = truth["hidden"]
    assert shown is not None
    # What is shown is the difference of the two simulations, which the answers hold at the same nodes.
    with_it, without = (np.load(tmp_path / "answers" / f"{name}_surface.npz") for name in ("pair", "other"))
    done = ((with_it["displacement"] - without["displacement"]) * without["normals"]).sum(axis=1)
    assert shown["shown_mm"] == pytest.approx(np.sqrt(np.mean(done**2)), rel=0.1)
    assert 0.0 < shown["left_mm"] < shown["shown_mm"]
    assert shown["left_near_mm"] > 0.3 * shown["left_mm"]
    # A whole half that is a little stiffer is a stiffness, so that nothing is left, on the surface or near it.
    whole = {"inclusion": {"half": "prostate_left", "radius_mm": 30, "factor": 1.1}}
    stiffer = run_simulate({**spec, "hidden": whole}, tmp_path / "stiffer", tmp_path / "answers")["hidden"]
    assert stiffer is not None
    assert max(stiffer["left_mm"], stiffer["left_near_mm"]) < 0.1 * stiffer["shown_mm"]
    assert json.loads((tmp_path / "answers" / "pair.json").read_text())["spec"]["hidden"] == hidden
    for file in (tmp_path / "pair").rglob("*.json"):
        assert "heterogeneity" not in file.read_text()
