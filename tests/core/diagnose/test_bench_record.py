"""What diagnosis.json says of a body on a bench, on arrays: two states of two markers, the second one with a reaction force."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.bench_bodies import record
from palpate.core.diagnose.bench_bodies.judge import BodyDiagnosis, patches_of, split_of, unnamed
from palpate.core.diagnose.bench_bodies.problem import BodyPatch, BodyProblem, BodyState, PatchFacts, PointLoad
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.fem.meshes import box

NAN = np.nan
# Rows of both states' data, 0 to 3 and 4 to 9: markers along the axes seen, then in the second state two reactions.
SEEN = [np.array([[True, True, False], [True, False, False]]), np.array([[True, True, True], [True, False, False]])]
ROWS = [slice(0, 3), slice(3, 9)]
PLAIN = np.array([3.0, 4.0, 1.0, 2.0, 1.0, 2.0, 4.0, 0.5, -0.25])
WITH = 0.5 * PLAIN
VARIANCE = np.array([0.04, 0.04, 0.01, 0.09, 0.09, 0.09, 0.01, 0.25, 0.25])
MESH = box((10.0, 4.0, 4.0), (2, 1, 1))


def missed(r: FloatArray) -> list[FloatArray]:
    out = []
    for seen, rows in zip(SEEN, ROWS, strict=True):
        one = np.full((2, 3), NAN)
        one[seen] = r[rows][: seen.sum()]
        out.append(one)
    return out


def base() -> Any:
    facts = PatchFacts("grip", (0.0, None, -2.0), reaction_n=(1.5, None, -3.0), reaction_sd_n=(0.1, None, 0.2), state=1)
    patch = BodyPatch(np.zeros((0, 3), dtype=int), facts)
    at = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    states = tuple(
        BodyState(name, at, at, (0.1, 0.1, 0.1), (0.0, 0.0, 0.0), loads)
        for name, loads in (("rest", ()), ("pulled", (PointLoad((1.0, 1.0, 1.0), (0.0, 1.0, -2.0)),)))
    )
    equilibrium = SimpleNamespace(u=np.ones((len(MESH.points) + 5, 3)))
    problem = BodyProblem(MESH, MESH.boundary[0][:1], states, 1000.0, (5.0, 500.0), True, patches=(patch,))
    data = [SimpleNamespace(seen=s, n_seen=int(s.sum()), moved=np.full((2, 3), 7.0)) for s in SEEN]
    linearisation = SimpleNamespace(
        residual=PLAIN, each=[SimpleNamespace(equilibrium=equilibrium)] * 2, theta=None, phi=None
    )
    plain = SimpleNamespace(
        linearisation=linearisation,
        weighting=SimpleNamespace(covariance=np.diag(VARIANCE)),
        model=SimpleNamespace(rows=ROWS, n=9),
        posterior=SimpleNamespace(mean=np.log([30.0]), sd=np.array([0.2])),
    )
    return SimpleNamespace(problem=problem, data=data, plain=plain, missed=missed, options=SimpleNamespace(
        decision_rules=DecisionRules(), noise_model=SimpleNamespace(markers_common=0.7)), element="p2p1")  # fmt: skip


def lead() -> Any:
    effect = SimpleNamespace(id="gravity_change", words="gravity turned")
    equilibrium = SimpleNamespace(u=np.full((len(MESH.points) + 5, 3), 2.0))
    return SimpleNamespace(
        hypothesis=SimpleNamespace(effect=effect),
        linearisation=SimpleNamespace(
            residual=WITH, theta=np.log([25.0]), phi=None, each=[SimpleNamespace(equilibrium=equilibrium)] * 2
        ),
        covariance=np.array([[0.09]]),
        phi=np.ones(1),
    )


def found(left_out: dict[str, FloatArray]) -> BodyDiagnosis:
    nothing: Any = SimpleNamespace(lead=lead())
    verdict: Any = SimpleNamespace(verdict="gravity_change", candidates=("gravity_change",))
    return BodyDiagnosis(base(), nothing, verdict, left_out)


def test_the_gap_counts_markers_along_the_axes_seen() -> None:
    test: Any = SimpleNamespace(detected=True, p_value=0.01, log_factor=4.0)
    got = record.gap(base(), test)
    distances = np.array([5.0, 1.0, 3.0, 4.0])
    assert got.rms_mm == pytest.approx(np.sqrt(np.mean(distances**2)))
    assert got.p95_mm == pytest.approx(np.quantile(distances, 0.95))
    assert got.noise_floor_mm == pytest.approx(np.sqrt((0.09 + 0.28) / 4.0))
    assert (got.detected, got.p_value, got.statistic) == (True, 0.01, 4.0)


def test_each_state_has_its_share_of_all_squares() -> None:
    first, second = record.regions(base())
    assert (first.name, first.side, first.rms_mm, first.share) == (
        "rest",
        "all",
        pytest.approx(np.sqrt(13.0)),
        pytest.approx(26.0 / 51.0),
    )
    assert (second.rms_mm, second.share) == (pytest.approx(np.sqrt(12.5)), pytest.approx(25.0 / 51.0))


def test_a_stiffness_has_half_its_68_per_cent_interval() -> None:
    assert record.plain_stiffness(base())["body"].sd_kpa == pytest.approx(30.0 * np.sinh(0.2))
    beside = record.stiffness_with(lead())["body"]
    assert (beside.G_kpa, beside.sd_ln_G, beside.sd_kpa) == pytest.approx((25.0, 0.3, 25.0 * np.sinh(0.3)))


def test_what_an_effect_gains_is_told_of_states_that_were_left_out() -> None:
    case = found({"": PLAIN, "gravity_change": WITH, "other": 2.0 * PLAIN})
    before = np.sqrt((13.0 + 12.5) / 2.0)
    assert record.gains_mm(case) == pytest.approx({"gravity_change": 0.5 * before, "other": -before})
    got = record.shrinkage(case, lead())
    assert got is not None
    assert (got.held_out_rms_before_mm, got.held_out_rms_after_mm) == pytest.approx((before, 0.5 * before))
    assert (got.fraction, got.ci95, got.effect) == (pytest.approx(0.5), pytest.approx((0.5, 0.5)), "gravity_change")
    uneven = WITH.copy()
    uneven[ROWS[1]] = 0.1 * PLAIN[ROWS[1]]
    wide = record.shrinkage(found({"": PLAIN, "gravity_change": uneven}), lead())
    assert wide is not None and wide.ci95 == pytest.approx((0.5, 0.9))


def test_one_state_alone_foretells_nothing() -> None:
    case = found({"": PLAIN, "gravity_change": WITH})
    case.base.data.pop()  # type: ignore[attr-defined]
    assert record.gains_mm(case) == {}
    assert record.shrinkage(case, lead()) is None


def test_every_state_has_its_misfit_before_and_after_and_its_forces() -> None:
    case = found({"": 3.0 * PLAIN, "gravity_change": PLAIN})
    first, second = record.states(case, lead())
    assert (first.name, first.markers, second.name) == ("rest", 2, "pulled")
    assert (first.rms_before_mm, first.rms_after_mm) == pytest.approx((np.sqrt(13.0), 0.5 * np.sqrt(13.0)))
    assert (second.held_out_before_mm, second.held_out_after_mm) == pytest.approx((3.0 * np.sqrt(12.5), np.sqrt(12.5)))
    assert first.noise_mm == pytest.approx(np.sqrt(0.045)) and second.noise_mm == pytest.approx(np.sqrt(0.14))
    assert isinstance(second.reactions, list) and not isinstance(first.reactions, list)
    along_x, along_z = second.reactions
    assert (along_x.patch, along_x.axis, along_x.measured_n, along_x.sd_n) == ("grip", "x", 1.5, 0.1)
    assert (along_x.before_n, along_x.after_n) == pytest.approx((2.0, 1.75))
    assert (along_z.axis, along_z.before_n, along_z.after_n) == ("z", pytest.approx(-3.25), pytest.approx(-3.125))
    alone = record.states(found({"": PLAIN}), None)
    assert isinstance(alone[1].reactions, list) and alone[1].reactions[0].after_n is None
    assert not isinstance(alone[0].rms_after_mm, float)


def test_the_next_state_is_the_load_under_which_both_models_differ_most(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a load markers differ by 1 mm, with twice as much by the factor times 2 mm; the pull and the grip are scaled."""
    asked: list[tuple[float, float | None]] = []

    def model(problem: Any, state: int, element: str, common: float) -> Any:
        assert (state, element, common) == (1, "p2p1", 0.7)
        load, grip = problem.states[1].loads[0].force_n, problem.patches[0].facts.displacement_mm
        asked.append((load[2], grip[2]))
        assert load[1] == -0.5 * load[2] and grip[1] is None
        size = 1.0 if load[2] == 0.0 else 4.0

        def solve(hypothesis: Any, theta: Any, phi: Any, near: None) -> Any:
            plain = getattr(hypothesis, "effect", None) is None
            return SimpleNamespace(equilibrium=SimpleNamespace(u=np.full((2, 3), 0.0 if plain else size)))

        markers = SimpleNamespace(motion=lambda u: u[:, :1])
        return SimpleNamespace(solve=solve, marker_data=SimpleNamespace(markers=markers))

    monkeypatch.setattr(record, "state_model", model)
    said = record.next_state(base(), lead())
    assert asked == [(0.0, 0.0), (-4.0, -4.0)]
    assert said is not None
    assert "with twice the load the models' markers differ by 4.0 mm (with no load by 1.0 mm)" in said
    assert "tells gravity change from another stiffness" in said
    still = base()
    unloaded = tuple(replace(state, loads=()) for state in still.problem.states)
    still.problem = replace(still.problem, states=unloaded, patches=())
    assert record.next_state(still, lead()) is None


@pytest.mark.parametrize("lacking", ["plain", "effect"])
def test_a_load_that_one_model_cannot_carry_is_not_asked_for(lacking: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def model(problem: Any, *_: Any) -> Any:
        def solve(hypothesis: Any, *_: Any) -> Any:
            kind = "plain" if getattr(hypothesis, "effect", None) is None else "effect"
            heavy = problem.states[1].loads[0].force_n[2] != 0.0
            return (
                None if heavy and kind == lacking else SimpleNamespace(equilibrium=SimpleNamespace(u=np.ones((2, 3))))
            )

        markers = SimpleNamespace(motion=lambda u: u)
        return SimpleNamespace(solve=solve, marker_data=SimpleNamespace(markers=markers))

    monkeypatch.setattr(record, "state_model", model)
    assert record.next_state(base(), lead()) is None


def test_the_words_say_what_is_missed_and_why() -> None:
    missed_mm, left_mm = np.sqrt(51.0 / 4.0), 0.5 * np.sqrt(51.0 / 4.0)
    assert (
        record.words(base(), "none", None)
        == f"The plain model misses the markers by {missed_mm:.2f} mm, no more than their own error."
    )
    assert record.words(base(), "ambiguous", None).endswith("these states cannot tell why.")
    assert record.words(base(), "unknown", None).endswith("nothing in the library explains it.")
    said = record.words(base(), "gravity_change", lead())
    assert said.endswith(f"because gravity turned; with it the states are missed by {left_mm:.2f} mm.")
    remainder = record.remainder(base(), lead())
    assert remainder.rms_mm == pytest.approx({"rest": 0.5 * np.sqrt(13.0), "pulled": 0.5 * np.sqrt(12.5)})


def test_the_maps_are_of_the_best_effect_where_there_is_one() -> None:
    plain, both = record.maps(base(), None), record.maps(base(), lead())
    assert "state_1/residual_after" not in plain
    np.testing.assert_array_equal(both["state_2/residual_after"][0], WITH[3:6])
    np.testing.assert_array_equal(both["state_2/residual"][1], [4.0, NAN, NAN])
    assert plain["state_1/displacement"].tolist() == np.ones_like(MESH.points).tolist()
    assert both["state_1/displacement"].tolist() == np.full_like(MESH.points, 2.0).tolist()
    assert both["state_2/moved"][0, 0] == 7.0


def test_a_state_is_left_out_as_a_whole_and_of_one_state_each_marker() -> None:
    several = base()
    assert patches_of(several).tolist() == [0, 0, 0, 1, 1, 1, 1, 1, 1]
    split = split_of(several)
    np.testing.assert_array_equal(split.covariance, np.diag(VARIANCE))
    assert split.parts == {"markers": slice(0, 9)} and split.reader.tolist() == np.eye(9).tolist()
    one = base()
    one.data, one.plain.model = one.data[1:], SimpleNamespace(rows=[slice(0, 6)], n=6)
    assert patches_of(one).tolist() == [0, 0, 0, 1, -1, -1]


def test_what_has_no_name_shifts_a_state_s_markers_along_the_axes_seen() -> None:
    (one,) = unnamed(base())
    shifts = np.zeros((9, 5))
    shifts[[0, 2], 0] = shifts[1, 1] = shifts[[3, 6], 2] = shifts[4, 3] = shifts[5, 4] = 1.0
    np.testing.assert_array_equal(one.S, shifts)
    np.testing.assert_array_equal(one.scales, np.full(5, DecisionRules().bench_unnamed_mm))
