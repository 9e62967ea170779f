"""When the better element's correction is taken anew, on a model whose optimum is told beforehand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from palpate.core.observe.contour_noise import Weighting
from palpate.core.residual import plain_fit

SD = 0.1
START = np.log([20.0, 60.0])
BOUNDS = np.tile(np.log([5.0, 500.0]), (2, 1))


def at(theta: np.ndarray, corrected: int) -> Any:
    each = [SimpleNamespace(theta=theta)]
    return SimpleNamespace(theta=theta, residual=np.zeros(2), in_theta=np.eye(2) / SD, each=each, corrected=corrected)


class Errors:
    """Of one state; asked : at which theta they were taken anew."""

    def __init__(self, asked: list[np.ndarray]) -> None:
        self.asked = asked

    def moved_to(self, model: Any, here: Any, element: str) -> Errors:
        self.asked.append(here.theta)
        return self


@pytest.mark.parametrize(
    ("moves_sd", "taken"),
    [((0.05,), 0), ((0.5, 0.05), 1), ((-0.5, 0.05), 1), ((0.5, -0.4, 0.05), 2), ((0.5, 0.5, 0.5, 0.5), 3)],
)
def test_the_correction_is_taken_anew_while_the_fit_moves_and_three_times_at_most(
    moves_sd: tuple[float, ...], taken: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each search ends so many standard deviations from where the one before ended; a tenth is no move."""
    ends = START + SD * np.cumsum(np.outer(moves_sd, [1.0, 0.0]), axis=0)
    searches = iter(ends)
    asked: list[np.ndarray] = []
    model: Any = SimpleNamespace(each=[None], bounds=BOUNDS)
    monkeypatch.setattr(
        plain_fit,
        "best_of",
        lambda m, w, starts, here: SimpleNamespace(linearisation=at(next(searches), here.corrected)),
    )
    monkeypatch.setattr(plain_fit, "_corrected", lambda m, here, errors: (m, at(here.theta, here.corrected + 1)))
    monkeypatch.setattr(plain_fit, "solved", lambda m, theta, here: here)
    weighting = Weighting(np.eye(2))
    errors: Any = [Errors(asked)]
    _, here, _ = plain_fit._settled(model, weighting, at(START, 0), errors, "p2p1", lambda *_: None)
    assert len(asked) == here.corrected == taken
    np.testing.assert_allclose(np.reshape(asked, (taken, 2)), ends[:taken])
    np.testing.assert_allclose(here.theta, ends[min(taken, 2)])
