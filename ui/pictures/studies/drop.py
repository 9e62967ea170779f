"""The picture of `validate drop`: where the energy of a soft ball in a dish goes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from palpate.ui.pictures.studies.axes import finish, panels

if TYPE_CHECKING:
    from palpate.validate.drop.study import DropTable

_LINES = (("kinetic", "-"), ("elastic", "-"), ("gravity", "-"), ("contact", "-"))


def study_drop(study: DropTable) -> Figure:
    """Left: the kinds of energy over time. Right: their sum, and how far it ever rose above its lowest value before."""
    figure, (left, right) = panels(2)
    energies = {name: np.array(values) for name, values in study["ball_energies"].items()}
    times = 1e3 * energies["time_s"]
    for name, style in _LINES:
        left.plot(times, 1e-3 * energies[name], style, linewidth=1.2, label=name)
    right.plot(times, 1e-3 * energies["total"], color="black", label="mechanical energy")
    finish(left, "time (ms)", "energy (mJ)", "a soft ball falls into a dish")
    growth = 100.0 * float(study["ball"]["energy_growth"])
    finish(right, "time (ms)", "energy (mJ)", f"grew by at most {growth:.3f} % of the fall's energy")
    return figure
