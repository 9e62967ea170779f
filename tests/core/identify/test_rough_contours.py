"""Contours whose errors look like the strain that is sought tell nothing; better ones are searched with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import synthetic_case

from palpate.core.identify.pair.rigid_pair import rigid_pair
from palpate.core.identify.pair.rough_contours import contours_tell_nothing, strain_of_errors, too_rough
from palpate.core.problem import IdentificationProblem, SurfacePair


def with_errors(sd: float | None, common: float = 0.0) -> IdentificationProblem:
    problem = synthetic_case.problem()
    states = (problem.organ.rest, problem.organ.deformed)
    rest, deformed = (replace(s, sd_mm=None if sd is None else np.full(len(s.points), sd)) for s in states)
    return replace(problem, organ=SurfacePair(rest, deformed, common))


def test_errors_of_both_contours_read_as_a_strain() -> None:
    assert strain_of_errors(with_errors(None).organ) == 0.0
    # Two contours of a ball of 10 mm, its faces somewhat inside.
    assert strain_of_errors(with_errors(1.0).organ) == pytest.approx(np.sqrt(2.0) / 10.0, rel=0.05)
    assert strain_of_errors(with_errors(1.0, 0.5).organ) == pytest.approx(0.1, rel=0.05)


def test_rough_contours_tell_nothing_and_say_why() -> None:
    rough, fine = with_errors(2.0), with_errors(0.5)
    assert contours_tell_nothing(fine, rigid_pair(fine)) is None and too_rough(fine.organ) == ""
    told = contours_tell_nothing(rough, rigid_pair(rough))
    assert told is not None and "may be off by 2.0 and 2.0 mm" in told.in_words
    # The organ is shown moved as a whole: distances between its points stay.
    moved = told.points + told.displacement
    np.testing.assert_allclose(
        np.linalg.norm(moved - moved[0], axis=1), np.linalg.norm(told.points - told.points[0], axis=1)
    )
