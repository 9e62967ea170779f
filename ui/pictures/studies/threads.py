"""The picture of `validate threads`: the paper's Fig 14."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from palpate.ui.pictures.studies.axes import OTHER, OURS, finish, panels

if TYPE_CHECKING:
    from palpate.validate.paper.threads import ThreadsTable


def study_threads(study: ThreadsTable) -> Figure:
    """Left: seconds for the same particles. Right: speed-up, with the share that other work on the machine cannot hide."""
    figure, (left, right) = panels(2)
    workers = [int(w) for w in study["seconds"]]
    left.plot(workers, list(study["seconds"].values()), "o-", color=OURS, label="by the clock")
    left.plot(
        workers, [study["seconds"][str(workers[0])] * workers[0] / w for w in workers], ":", color="0.5", label="linear"
    )
    right.plot(workers, list(study["speed_up"].values()), "o-", color=OURS, label="by the clock")
    ideal = [w * study["efficiency"][str(w)] for w in workers]
    right.plot(workers, ideal, "s--", color=OTHER, label="workers times efficiency of their processor time")
    right.plot(workers, workers, ":", color="0.5", label="linear")
    for axes in (left, right):
        axes.set_xticks(workers)
        axes.set_ylim(0.0, None)
    finish(left, "worker processes", f"seconds for {study['particles']} particles", f"{study['cells']:,} cells")
    finish(right, "worker processes", "speed-up", f"{study['processors']} processors")
    return figure
