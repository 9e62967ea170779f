"""Both states of simulated patients in whom nothing is hidden."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from palpate.core.errors import ConvergenceError, InputError
from palpate.validate.calibration.simulators import SIMULATORS, Drawn
from palpate.validate.simulated.two_states import TwoStates

# Patients that are looked at for one whose walls can move as was drawn.
_PATIENTS = 8
VOXEL_MM = ((0.8, 1.5), (0.8, 3.0))


def solved_states(simulator: str, rng: np.random.Generator, G: tuple[float, float], meshes: Path | None) -> TwoStates:
    """Both states of the first patient whose walls can move as was drawn. Raises ConvergenceError when none of eight can."""
    for _ in range(_PATIENTS):
        try:
            return SIMULATORS[simulator](Drawn(rng, G, meshes))
        except (ConvergenceError, InputError) as error:
            why = error
    raise ConvergenceError(f"none of {_PATIENTS} simulated patients has an equilibrium ({why})")
