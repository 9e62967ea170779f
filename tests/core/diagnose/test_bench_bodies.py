"""A bar on a bench whose gravity the model leaves out: it bends as beam theory says, and gravity is found in its size."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from schemas import check_form

from palpate.core.diagnose.bench_bodies.diagnose import diagnose_body
from palpate.core.diagnose.bench_bodies.fit import fit_body
from palpate.core.diagnose.bench_bodies.judge import patches_of, split_of
from palpate.core.diagnose.bench_bodies.markers import Holder, Markers
from palpate.core.diagnose.bench_bodies.model import bench_model, marker_data
from palpate.core.diagnose.bench_bodies.on_bench import BodySurroundings, on_bench
from palpate.core.diagnose.bench_bodies.problem import BODY, BodyPatch, BodyProblem, BodyState, PatchFacts, PointLoad
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.effects import Surroundings, library
from palpate.core.diagnose.options import DiagnosisOptions
from palpate.core.errors import InputError
from palpate.core.fem.meshes import box
from palpate.core.fem.space import Space
from palpate.core.files.json_types import plain
from palpate.core.mesh import TetMesh
from palpate.core.residual.linearised_model import Hypothesis
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter

# Asymmetric on purpose: length along x, width y, height z, mm.
LENGTH, WIDTH, HEIGHT = 60.0, 22.0, 16.0
DENSITY, DOWN = 1200.0, (0.0, 0.0, -9.81)
MARKERS = ((60.0, 4.0, 24.0), (60.0, 20.0, 3.0), (48.0, 11.0, 16.0))
KIND = "palpate.core.diagnose.bench_bodies.diagnose:run"
# Some of the library, for speed: with two effects alone their pair would have a tenth of the prior to itself.
EFFECTS = {k: library()[k] for k in ("gravity_change", "compressible_organ", "volume_change", "bone_motion")}


def bar(*loads_n: float, model_gravity: bool) -> BodyProblem:
    made = box((LENGTH, WIDTH, HEIGHT), (6, 2, 2))
    mesh = TetMesh(made.points, made.cells, np.full(len(made.cells), BODY))
    faces = mesh.boundary[0]
    held = faces[(mesh.points[faces][..., 0] < 1e-9).all(axis=1)]
    states = tuple(
        BodyState(f"{n} N", MARKERS, MARKERS, (0.15,) * 3, DOWN, (PointLoad((LENGTH, 11.0, HEIGHT), (0.0, 0.0, -n)),))
        for n in loads_n
    )
    return BodyProblem(mesh, held, states, DENSITY, (5.0, 500.0), model_gravity)


def seen(problem: BodyProblem, G: float, seed: int = 2) -> BodyProblem:
    """What the markers would show of the bar with gravity, with noise."""
    model = bench_model(replace(problem, model_gravity=True), "p2p1", 0.7)
    solved = model.plain(np.log([G]), None)
    assert solved is not None
    rng, states = np.random.default_rng(seed), []
    for s, data, one in zip(problem.states, marker_data(model), solved.each, strict=True):
        noisy = one.residual + np.linalg.cholesky(data.covariance) @ rng.standard_normal(data.n)
        x = data.missed(noisy) + data.moved + s.rest
        states.append(replace(s, deformed=tuple(tuple(row) for row in x.tolist())))
    return replace(problem, states=tuple(states))


def test_a_bar_bends_under_its_weight_as_beam_theory_says() -> None:
    """w L^4 / 8 E I + w L^2 / 2 k G A (Timoshenko); a clamp that holds the root's width makes so short a bar a tenth stiffer."""
    problem, G = bar(0.0, model_gravity=True), 300.0
    solved = bench_model(problem, "p2p1", 0.7).plain(np.log([G]), None)
    assert solved is not None
    w = DENSITY * 9.81e-6 * WIDTH * HEIGHT  # mN/mm
    bending = w * LENGTH**4 / (8.0 * 2.99 * G * WIDTH * HEIGHT**3 / 12.0)
    shear = w * LENGTH**2 / (2.0 * 5.0 / 6.0 * G * WIDTH * HEIGHT)
    tip = solved.first.scene.space.nodes[:, 0] > LENGTH - 1e-9
    assert 0.8 < -solved.first.equilibrium.u[tip, 2].mean() / (bending + shear) < 1.0


def test_a_marker_off_the_body_turns_with_it() -> None:
    model = bench_model(bar(0.0, model_gravity=False), "p2p1", 0.7)
    markers = marker_data(model)[0].markers
    assert markers.off_body.tolist() == [True, False, False]
    angle = np.deg2rad(20.0)
    R = np.array([[np.cos(angle), 0.0, -np.sin(angle)], [0.0, 1.0, 0.0], [np.sin(angle), 0.0, np.cos(angle)]])
    X = model.first.geometry.space.nodes
    moved = markers.motion(X @ R.T - X + [1.0, -2.0, 0.5])
    np.testing.assert_allclose(moved, np.array(MARKERS) @ R.T - MARKERS + [1.0, -2.0, 0.5], atol=1e-9)


@pytest.mark.parametrize("reach", [0.1, 2.5, 4.0])
def test_a_holder_stands_on_the_nodes_within_reach_of_the_nearest_one_and_on_five_at_least(
    reach: float,
) -> None:
    X = np.column_stack([np.arange(12.0), np.zeros(12), np.zeros(12)])
    holder = Holder.of(X, np.array([-3.0, 1.0, 0.0]), reach)
    assert holder.nodes.tolist() == [0, 1, 2, 3, 4]
    np.testing.assert_allclose(holder.arms.sum(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(holder.arm, [-5.0, 1.0, 0.0])
    assert Holder.of(X, np.array([-3.0, 1.0, 0.0]), 6.5).nodes.tolist() == [0, 1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize(("above_mm", "off"), [(2.2, False), (2.3, True)])
def test_a_marker_within_a_quarter_of_a_cell_s_edge_is_on_the_body(above_mm: float, off: bool) -> None:
    """Cubes of 8 mm in six tetrahedra each of the mean volume of a regular one with edges of 9.0 mm: a quarter is 2.25 mm."""
    space = Space.of(box((24.0, 24.0, 24.0), (3, 3, 3)), "p1p1")
    assert (8.0**3 / len(space.mesh.cells) * 27 * 6.0 * np.sqrt(2.0)) ** (1.0 / 3.0) == pytest.approx(8.98, abs=0.01)
    assert Markers.of(space, np.array([[11.0, 13.0, 24.0 + above_mm]])).off_body.tolist() == [off]


def test_the_foot_of_a_holder_is_as_wide_as_the_body_allows() -> None:
    """Three tenths of the cube root of a small body's volume, 12 mm of a large one."""
    for size, reach in ((24.0, 7.2), (120.0, 12.0)):
        space = Space.of(box((size, size, size), (22, 22, 1)), "p1p1")
        (holder,) = Markers.of(space, np.array([[0.5 * size, 0.5 * size, 2.0 * size]])).holders
        foot = space.nodes[holder.nodes]
        middle = np.array([0.5 * size, 0.5 * size, size])
        inside = np.linalg.norm(space.nodes - middle, axis=1) <= reach + 1e-9
        np.testing.assert_array_equal(foot, space.nodes[inside])


@pytest.mark.parametrize("angle", [0.0, 35.0, 90.0, 140.0, -70.0])
def test_a_holder_on_a_flat_foot_turns_and_is_never_mirrored(angle: float) -> None:
    X = np.stack(np.meshgrid(np.arange(3.0), np.arange(3.0), [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    holder = Holder.of(X, np.array([1.0, 1.0, 5.0]), 10.0)
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    R = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]) @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    moved = holder.motion((X - [1.0, 1.0, 0.0]) @ R.T + [1.0, 1.0, 0.0] - X)
    np.testing.assert_allclose(moved, R @ [0.0, 0.0, 5.0] - [0.0, 0.0, 5.0], atol=1e-9)


def test_the_motion_of_markers_changes_by_its_derivative() -> None:
    model = bench_model(bar(0.0, model_gravity=False), "p2p1", 0.7)
    markers, X = marker_data(model)[0].markers, model.first.geometry.space.nodes
    u, move = 2.0 * np.sin(0.1 * X[:, [1, 2, 0]]), np.cos(0.2 * X)
    h = 1e-5
    expected = (markers.motion(u + h * move) - markers.motion(u - h * move)) / (2.0 * h)
    np.testing.assert_allclose(markers.change(u, move), expected, atol=1e-8)


def test_gravity_as_an_effect_is_the_gravity_that_a_model_has() -> None:
    """At 9.81 m/s2 the effect on a model without gravity is the model with it; one that has it has nothing to add."""
    without, with_it = bar(0.1, model_gravity=False), bar(0.1, model_gravity=True)
    (known,) = on_bench({"gravity_change": EFFECTS["gravity_change"]}, without).values()
    (variant,) = known.variants(Surroundings(without.shell))
    at = np.log([80.0])
    added = bench_model(without, "p2p1", 0.7).solve(Hypothesis(known, variant), at, np.array([9.81]), None)
    modelled = bench_model(with_it, "p2p1", 0.7).plain(at, None)
    assert added is not None and modelled is not None
    np.testing.assert_allclose(added.residual, modelled.residual, atol=1e-6)
    (nothing,) = on_bench({"gravity_change": EFFECTS["gravity_change"]}, with_it).values()
    assert nothing.variants(Surroundings(with_it.shell)) == []


def test_gravity_that_the_model_leaves_out_is_found_in_its_size() -> None:
    found, maps = diagnose_body(seen(bar(0.0, 0.08, 0.15, model_gravity=False), 60.0), EFFECTS, "bar")
    found = plain(found)
    check_form(found, "diagnosis")
    assert found["verdict"] == "gravity_change"
    assert found["ranking"][0]["parameters"]["change"]["value"] == pytest.approx(9.81, rel=0.1)
    assert found["stiffness"]["with_effect"]["body"]["G_kpa"] == pytest.approx(60.0, rel=0.1)
    shrunk = found["shrinkage"]
    assert shrunk["held_out_rms_after_mm"] < 0.3 * shrunk["held_out_rms_before_mm"]
    # The interval reaches from the state that gains least to the one that gains most.
    assert 0.0 < shrunk["ci95"][0] < shrunk["fraction"] < shrunk["ci95"][1] < 1.0
    assert shrunk["fraction"] == 1.0 - shrunk["held_out_rms_after_mm"] / shrunk["held_out_rms_before_mm"]
    for k in range(3):
        for name, when in (("residual", "before"), ("residual_after", "after")):
            distance = np.linalg.norm(maps[f"state_{k + 1}/{name}"], axis=1)
            assert np.sqrt((distance**2).mean()) == pytest.approx(found["states"][k][f"rms_{when}_mm"])


def test_places_in_a_large_body_lie_farther_apart() -> None:
    """Six tenths of the cube root of its volume, where an organ's spacing would be less."""
    problem = bar(0.0, model_gravity=False)
    around = BodySurroundings(problem.shell)
    size = float(problem.shell.mesh.volumes.sum()) ** (1.0 / 3.0)
    candidates = around.cell_centres
    told = around.spread_points(candidates, 0.1 * size)
    np.testing.assert_array_equal(told, Surroundings(problem.shell).spread_points(candidates, 0.6 * size))
    wider = around.spread_points(candidates, 2.0 * size)
    np.testing.assert_array_equal(wider, Surroundings(problem.shell).spread_points(candidates, 2.0 * size))
    assert len(wider) < len(told)


def test_a_model_with_gravity_has_no_gap() -> None:
    found, _ = diagnose_body(seen(bar(0.0, 0.1, model_gravity=True), 60.0), EFFECTS, "bar")
    found = plain(found)
    assert found["verdict"] == "none"
    assert found["gap"]["p_value"] > 0.05


def test_a_body_survives_its_file(tmp_path: Path) -> None:
    problem = bar(0.0, 0.1, model_gravity=False)
    disc = BodyPatch(problem.held[:2], PatchFacts("disc", (0.5, None, 0.0), state=1), problem.held[1:])
    state = replace(problem.states[0], deformed=((1.0, None, 2.0),) * 3, sd_mm=(0.1, None, 0.2), common=0.3)
    problem = replace(problem, patches=(disc,), states=(state, problem.states[1]))
    np.savez(tmp_path / "data.npz", **problem.arrays())
    with np.load(tmp_path / "data.npz") as data:
        back = BodyProblem.from_arrays(dict(data))
    assert back.states == problem.states
    assert (back.model_gravity, back.density_kg_m3, back.bounds_kpa) == (False, DENSITY, (5.0, 500.0))
    assert back.patches[0].facts == disc.facts
    np.testing.assert_array_equal(back.patches[0].faces, disc.faces)
    np.testing.assert_array_equal(back.patches[0].rim, disc.rim)
    with pytest.raises(InputError, match="not the data of a body"):
        BodyProblem.from_arrays({"points": problem.mesh.points})


def test_the_numbers_of_a_job_decide_and_are_recorded(tmp_path: Path) -> None:
    """At a level of 1, and where nothing is held for improbable, whatever is left is a gap; markers on holders that err each by itself
    have another p-value."""
    problem = bar(0.0, 0.1, model_gravity=True)
    on_holders = tuple(replace(s, rest=MARKERS[:1] * 2, deformed=MARKERS[:1] * 2) for s in problem.states)
    np.savez(tmp_path / "data.npz", **seen(replace(problem, states=on_holders), 60.0).arrays())
    whatever = DecisionRules(level=1.0, prior_nothing=1e-6)
    other = DiagnosisOptions(noise_model=NoiseModelOptions(markers_common=0.1), decision_rules=whatever)
    told = []
    for numbers in (DiagnosisOptions(), other):
        options = {"case": "bar", "effects": None, "numbers": numbers.to_json()}
        job = Job(KIND, str(tmp_path), {"data": str(tmp_path / "data.npz")}, options)
        told.append(plain(job.function()(job, Reporter(lambda _: None))))
        assert DiagnosisOptions.from_json(told[-1]["options"]) == numbers
    assert [t["gap"]["detected"] for t in told] == [False, True]
    assert told[0]["verdict"] == "none" != told[1]["verdict"]
    assert told[1]["gap"]["p_value"] != pytest.approx(told[0]["gap"]["p_value"], rel=0.01)


def test_of_several_states_each_is_left_out_and_of_one_each_marker() -> None:
    three = fit_body(seen(bar(0.0, 0.08, 0.15, model_gravity=True), 60.0))
    np.testing.assert_array_equal(patches_of(three), np.repeat([0, 1, 2], 9))
    one = fit_body(seen(bar(0.1, model_gravity=True), 60.0))
    np.testing.assert_array_equal(patches_of(one), np.repeat([0, 1, 2], 3))
    assert split_of(one).n_patches == 3


def test_gravity_that_the_stiffness_hides_in_one_state_is_told() -> None:
    found, _ = diagnose_body(seen(bar(0.1, model_gravity=False), 60.0), EFFECTS, "bar")
    assert (found.verdict, found.candidates) == ("ambiguous", ["gravity_change"])
    assert found.next_measurement is not None and "a further load" in found.next_measurement
