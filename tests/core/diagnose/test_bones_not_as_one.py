"""A motion of the bones is no single name where slices lie aside: the patient may have moved during the scan."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.effects import library
from palpate.core.diagnose.verdict.judge import _unlike
from palpate.core.observe.slice_step import SliceStep

RULES = DecisionRules()
ROWS = slice(4, 10)


def _said(step: SliceStep, effect: str = "bone_motion", moves_bone: bool = True) -> str:
    """What is said of an effect's refit in a case of two states, whose second one's bones have this step."""
    still = SimpleNamespace(data=SimpleNamespace(bone=None))
    moved = SimpleNamespace(data=SimpleNamespace(bone=SimpleNamespace(step=step)))
    fit: Any = SimpleNamespace(model=SimpleNamespace(each=[still, moved], bones=[None, ROWS]))
    known = library(None)[effect]
    in_phi = np.zeros((12, len(known.parameters)))
    in_phi[ROWS] = float(moves_bone)
    refit: Any = SimpleNamespace(
        hypothesis=SimpleNamespace(effect=known), phi=np.ones(len(known.parameters)), in_phi=in_phi
    )
    return _unlike(fit, refit, RULES)


def test_slices_that_lie_aside_are_no_motion_of_bone() -> None:
    assert "above z = 12 mm they lie 4.3 mm aside" in _said(SliceStep(0.7, 12.2, 4.31))


@pytest.mark.parametrize(
    ("step", "effect", "moves_bone"),
    [
        (SliceStep(0.2, 12.0, 4.0), "bone_motion", True),  # one rigid motion leaves other things
        (SliceStep(0.7, 12.0, 0.5), "bone_motion", True),  # no more than errors of their surfaces
        (SliceStep(0.7, 12.0, 4.0), "volume_change", False),  # no effect that moves bone
    ],
)
def test_else_the_name_means_what_it_says(step: SliceStep, effect: str, moves_bone: bool) -> None:
    assert _said(step, effect, moves_bone) == ""
