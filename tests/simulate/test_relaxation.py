"""How far gliding walls go in a round."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.simulate.solve import _PACES, _relaxed


@pytest.mark.parametrize("swing", [-2.0, -0.9, 0.3])
def test_walls_that_swing_evenly_are_met_by_the_second_change(swing: float) -> None:
    """Of a map x -> swing x, whose fixed point is 0, two changes tell the share that ends there."""
    x = np.array([[3.0, -1.0, 2.0]])
    last = (swing - 1.0) * x
    x = x + 0.7 * last
    change = (swing - 1.0) * x
    assert x + _relaxed(0.7, last, change) * change == pytest.approx(np.zeros((1, 3)), abs=1e-12)


@pytest.mark.parametrize(("factor", "share"), [(0.99, _PACES[1]), (-30.0, _PACES[0]), (1.0, _PACES[0])])
def test_no_round_goes_all_too_far_or_hardly_on(factor: float, share: float) -> None:
    """A change that hardly shrinks asks for much more than all of it, one that grows for next to nothing; none tells nothing."""
    change = np.array([[1.0, 2.0, 0.5]])
    assert _relaxed(1.0, change, factor * change) == share
