"""The study of motion and contact as `palpate validate drop` runs, tells and draws it."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from palpate.core.worker.progress import Progress
from palpate.ui.pictures.studies.axes import finish, panels

if TYPE_CHECKING:
    from palpate.applications.drop.study import DropTable

_LINES = (("kinetic", "-"), ("elastic", "-"), ("gravity", "-"), ("contact", "-"))


def run(args: argparse.Namespace, progress: Progress) -> DropTable:
    """Motion and contact against closed forms."""
    from palpate.applications.drop import study as drop_study

    o = drop_study.DropStudyOptions
    return drop_study.drop_study(o.quick() if args.quick else o(), progress)


def text(found: DropTable) -> str:
    """A line a body."""
    block, bar, ball = found["block"], found["bar"], found["ball"]
    sliding, sticking = found["sliding"], found["sticking"]
    return "\n".join(
        [
            f"stiff block: fall off by {block['fall']:.1e}, impact speed by {block['impact_speed']:.1e}, "
            f"rebound height by {100 * block['rebound_height']:+.2f} %, time of return by {100 * block['return_time']:+.2f} %",
            f"bar of {found['bar_cells']} cells end on: contact of 2 L / c off by {100 * bar['contact_time']:+.2f} %, "
            f"rebound speed by {100 * bar['rebound_speed']:+.2f} %",
            f"block on a slope: way after 0.1 s off by {100 * sliding['slide']:+.2f} %; with more friction it creeps "
            f"{sticking['way']:.3f} mm",
            f"order of the time steps: {found['order']:.2f}",
            f"soft ball in a dish: energy never above its lowest by more than {100 * ball['energy_growth']:.3f} % of the fall's, "
            f"deepest penetration {ball['deepest_penetration_mm']:.3f} mm (nearest {ball['nearest_mm']:.3f} mm), "
            f"{ball['steps']} steps in {ball['seconds']:.1f} s",
            f"most that energy grew in any of them: {100 * found['energy_growth']:.3f} %",
        ]
    )


def picture(study: DropTable) -> Figure:
    """Where the energy of a soft ball in a dish goes.

    Left: the kinds of energy over time. Right: their sum, and how far it ever rose above its lowest value before.
    """
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
