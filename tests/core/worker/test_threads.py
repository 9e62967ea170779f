"""Parts in threads: order, exceptions, and the closest points that do not depend on how many there are."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from triangle_shapes import icosphere

from palpate.core.surfaces.closest_point import closest_points
from palpate.core.surfaces.triangle_tree import TriangleTree
from palpate.core.worker import threads


@pytest.mark.parametrize("cores", [1, 4])
def test_results_come_in_the_order_of_their_items(monkeypatch: pytest.MonkeyPatch, cores: int) -> None:
    monkeypatch.setattr(threads, "cores", lambda: cores)
    assert threads.in_threads(lambda k: k * k, range(50)) == [k * k for k in range(50)]


@pytest.mark.parametrize("cores", [1, 4])
def test_what_a_part_raises_is_raised(monkeypatch: pytest.MonkeyPatch, cores: int) -> None:
    monkeypatch.setattr(threads, "cores", lambda: cores)
    with pytest.raises(ZeroDivisionError, match="division"):
        threads.in_threads(lambda k: 1 // k, [2, 1, 0, 1])


def test_closest_points_are_the_same_bits_for_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """More points than one thread searches in a row; on the ball's centre all triangles are as near."""
    tree = TriangleTree.of(*icosphere(3))
    x = np.random.default_rng(1).uniform(-2.0, 2.0, (20_000, 3))
    x[::7] = 0.0
    found = []
    for cores in (1, 3):
        monkeypatch.setattr(threads, "cores", lambda n=cores: n)
        found.append(closest_points(tree, x))
    for name in ("distance", "point", "triangle", "barycentric", "signed", "part"):
        np.testing.assert_array_equal(getattr(found[0], name), getattr(found[1], name))


def test_parts_beside_a_block_are_waited_for_and_end_with_a_block_that_raises() -> None:
    begun, go = threading.Event(), threading.Event()
    done = []

    def part(k: int) -> int:
        begun.set()
        assert go.wait(20.0)
        done.append(k)
        return 10 * k

    with threads.beside(part, [1, 2]) as results:
        assert begun.wait(20.0) and done == []
        go.set()
        assert results() == [10, 20]
    begun.clear()
    go.clear()
    with pytest.raises(ValueError, match="the block"), threads.beside(part, [3, 4]):
        assert begun.wait(20.0)
        raise ValueError("the block")
    go.set()
    time.sleep(0.2)
    assert 4 not in done, "a part that had not begun when the block raised"


def test_what_a_part_beside_a_block_raises_is_raised_when_it_is_waited_for() -> None:
    with threads.beside(lambda k: 1 // k, [0]) as results, pytest.raises(ZeroDivisionError, match="division"):
        results()
