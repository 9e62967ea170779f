"""A body touched by a rigid sphere: derivatives, Hertz, the quick answer beside the full solve, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.applications.touch.body import Body
from palpate.applications.touch.full import FullTouch
from palpate.applications.touch.quick import QuickOptions, QuickTouch
from palpate.applications.touch.session import Session
from palpate.applications.touch.touch_study import (
    TouchOptions,
    halved_ellipsoid,
    hertz,
    random_pokes,
    touch_study,
)
from palpate.core.errors import InputError

RADIUS = 8.0


@pytest.fixture(scope="module")
def session() -> Session:
    return Session(halved_ellipsoid(4, 2), RADIUS)


@pytest.mark.parametrize("depth", [2.0, -2.0])
def test_forces_and_stiffness_are_the_derivatives_of_the_energy(session: Session, depth: float) -> None:
    s = session.body.surface
    contact = session.contact(s.nearest(np.array([15.0, -25.0, 9.0])), depth)
    rng = np.random.default_rng(0)
    u = 0.05 * rng.normal(size=(len(s.points), 3))
    v = rng.normal(size=u.shape)
    step = 1e-6

    def gradient(x: np.ndarray) -> np.ndarray:
        out = np.zeros(x.size)
        np.add.at(out, contact.unknowns, contact.evaluate(x, 1.0, 1)[1])
        return out

    energy = (contact.evaluate(u + step * v, 1.0, 0)[0] - contact.evaluate(u - step * v, 1.0, 0)[0]) / (2.0 * step)
    assert abs(energy) > 1.0 and energy == pytest.approx(gradient(u) @ v.ravel(), rel=1e-6)
    product = np.zeros(u.size)
    _, _, blocks = contact.evaluate(u, 1.0, 2)
    np.add.at(product, contact.unknowns, np.einsum("bij,bj->bi", blocks, v.ravel()[contact.unknowns]))
    difference = (gradient(u + step * v) - gradient(u - step * v)) / (2.0 * step)
    # Under the sphere the curvature of a gap deeper than in any equilibrium is held back, a little.
    assert np.abs(difference - product).max() < (1e-5 if depth < 0.0 else 0.1) * np.abs(product).max()


def test_a_ball_answers_as_hertz_says() -> None:
    rows = hertz(8)
    assert [row["depth_mm"] for row in rows] == [0.2, 0.3, 0.4, 0.6]
    assert max(abs(row["error"]) for row in rows) < 0.05


def test_quick_answers_are_within_one_percent_of_the_full_solve_and_know_their_error() -> None:
    found = touch_study(TouchOptions(pokes=14, fine=4, seed=3), halved_ellipsoid(4, 2))
    assert found["largest_error"] < 0.01
    assert found["error_above_estimate"] == 0
    assert found["corrected_by_full"] <= 2 and found["full_without_equilibrium"] == 0
    assert found["largest_error"] > 1e-7, "the full solve is not another way"


def test_the_full_solve_is_an_equilibrium_of_all_forces(session: Session) -> None:
    """What the probe presses with is what the bed takes up, whichever way the answer was found."""
    body, at = session.body, session.body.surface.nearest(np.array([-25.0, -3.0, 4.0]))
    contact = session.contact(at, 3.0)
    found = FullTouch(body).solve(contact)
    assert found.converged
    bed = 1.5 * body.tissue_kpa / body.radius * body.surface.node_area @ found.state.u[body.surface.nodes]
    assert np.allclose(bed, -found.force, rtol=1e-4, atol=1e-3 * np.linalg.norm(found.force))
    assert found.force @ at.normal > 0.0


def test_the_bed_lets_a_ball_move_as_endless_tissue_would() -> None:
    body = halved_ellipsoid(4, 2)
    assert 1.5 * body.tissue_kpa / body.radius * body.surface.node_area.sum() == pytest.approx(
        6.0 * np.pi * body.tissue_kpa * body.radius, rel=0.05
    )


def test_a_hard_half_is_felt_apart_from_a_soft_one(session: Session) -> None:
    felt = {}
    for name, x in (("left", 30.0), ("right", -30.0)):
        session.touch(np.array([x, 2.0, -3.0]))
        for depth in (1.0, 1.25, 1.5):
            answer = session.press(depth)
        assert answer.ok and session.body.names[answer.region] == name
        assert answer.stiffness_n_per_mm is not None
        felt[name] = (answer.force_n, answer.stiffness_n_per_mm)
    assert 1.8 < felt["right"][0] / felt["left"][0] < 3.0  # 60 and 20 kPa, the bed in series
    assert felt["right"][1] > 1.5 * felt["left"][1]


def test_a_pull_pulls_back_and_nothing_is_felt_without_touching(session: Session) -> None:
    with pytest.raises(InputError, match="touches nothing yet"):
        Session(session.body).press(1.0)
    session.touch(np.array([0.0, -30.0, 5.0]))
    pulled, nothing, pushed = session.press(-1.5), session.press(0.0), session.press(1.5)
    assert pulled.ok and pulled.force_n < -0.1 < abs(nothing.force_n) + 0.1 < pushed.force_n + 0.1
    assert abs(nothing.force_n) < 1e-6
    surface = session.body.surface
    top = int(np.argmin(np.linalg.norm(surface.rest - pulled.point, axis=1)))
    assert pulled.u[surface.nodes[top]] @ pulled.normal > 1.0


def test_the_probe_goes_no_farther_than_it_may(session: Session) -> None:
    session.touch(np.array([0.0, -30.0, 5.0]))
    assert session.press(99.0).indentation_mm == pytest.approx(0.65 * RADIUS)


def test_a_full_solve_corrects_what_the_quick_answer_cannot_vouch_for(session: Session) -> None:
    hasty = Session(session.body, RADIUS, QuickOptions(iterations=3, tolerance=1e-6))
    hasty.touch(np.array([-25.0, 4.0, 8.0]))
    answer = hasty.press(4.0)
    session.touch(np.array([-25.0, 4.0, 8.0]))
    assert answer.full and answer.ok
    assert answer.force_n == pytest.approx(session.press(4.0).force_n, rel=0.01)
    alone = QuickTouch(session.body, QuickOptions(iterations=3, tolerance=1e-6))
    lost = alone.answer(random_pokes(session, TouchOptions(pokes=1))[0])
    assert not lost.good and lost.estimate > 0.0


def test_what_cannot_be_touched_is_refused() -> None:
    mesh = halved_ellipsoid(2, 1).mesh
    with pytest.raises(InputError, match="support 'hook' is unknown; choose one of bed, table"):
        Body(mesh, {1: 20.0, 2: 20.0}, {1: "left", 2: "right"}, support="hook")
    with pytest.raises(InputError, match=r"regions \[2\] of the body have no stiffness"):
        Body(mesh, {1: 20.0}, {1: "left"})
    with pytest.raises(InputError, match=r"radius of 0\.1 mm is out of range; give 0\.5 to 50"):
        Session(halved_ellipsoid(2, 1), 0.1)
