"""The picture of `validate sensitivity`: the paper's Fig 8."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from palpate.ui.pictures.studies.axes import OTHER, OURS, finish, panels

if TYPE_CHECKING:
    from palpate.validate.paper.sensitivity import SensitivityTable

_LOOKS = {"linear": (OTHER, "s"), "nonlinear": (OURS, "o")}


def study_sensitivity(study: SensitivityTable) -> Figure:
    """Left: how far the sphere is drawn out. Right: by how much that changes with its stiffness."""
    figure, (left, right) = panels(2)
    for name, (colour, marker) in _LOOKS.items():
        left.plot(study["relative"], study["axis_ratio"][name], color=colour, marker=marker, markersize=3, label=name)
        right.plot(
            study["relative"], np.abs(study["slope"][name]), color=colour, marker=marker, markersize=3, label=name
        )
    for axes in (left, right):
        axes.set_xscale("log")
        axes.set_xticks([0.3, 1.0, 3.0, 9.0], ["0.3", "1", "3", "9"])
        axes.minorticks_off()
    right.set_yscale("log")
    finish(left, "stiffness relative to the surroundings", "major over minor axis", "(a) deformation by one force")
    finish(right, "stiffness relative to the surroundings", "|slope| of (a)", "(b) its slope")
    steeper = len(study["nonlinear_steeper_at"])
    right.annotate(f"nonlinear steeper at {steeper} of {len(study['relative'])}; the paper: almost always",
                   (0.03, 0.04), xycoords="axes fraction", fontsize=7)  # fmt: skip
    return figure
