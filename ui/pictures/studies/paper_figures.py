"""The pictures of the paper's Figs 8, 10, 11, 13 and 14 as `palpate validate` has them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from palpate.ui.pictures.element_errors import COLOURS
from palpate.ui.pictures.studies.axes import OTHER, OURS, PAPER, TRUTH, finish, panels

if TYPE_CHECKING:
    from palpate.validate.paper.cohort import CohortTable, RealPatient, VirtualPatient
    from palpate.validate.paper.resolution import ResolutionTable
    from palpate.validate.paper.sensitivity import SensitivityTable
    from palpate.validate.paper.swarm import SwarmTable
    from palpate.validate.paper.threads import ThreadsTable


_LOOKS = {"linear": (OTHER, "s"), "nonlinear": (OURS, "o")}
_LINES = ((0, (1, 1)), ":", "--", "-")
_TICKS = [5, 20, 100, 500]
_WORDS = {"truth": "what it has", "clean": "found without noise", "noisy": "found with noise", "table": "of the table"}


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


def study_resolution(study: ResolutionTable) -> Figure:
    """Left: error of the normal half. Right: what is found of the tumour's half. A colour an element, a line a mesh."""
    figure, (left, right) = panels(2, 4.4, 3.6)
    share = 100.0 * np.array(study["share"])
    elements = list(dict.fromkeys(row["element"] for row in study["rows"]))
    meshes = sorted({row["nodes"] for row in study["rows"]})
    for row in study["rows"]:
        line = _LINES[meshes.index(row["nodes"]) - len(meshes)]
        label = f"{row['element']}, {row['nodes']} points"
        for axes, values, said in ((left, row["normal_error_percent"], label), (right, row["tumour_mu_kpa"], None)):
            axes.plot(share, values, label=said, color=COLOURS[row["element"]], linestyle=line, linewidth=1.1)
    right.plot(
        share, study["effective_mu_kpa"], "o", color=TRUTH, markersize=3, label="it has: mean stress over mean strain"
    )
    finish(left, "tumour's share of its half, %", "error of the normal half, %", "without noise", legend=False)
    finish(right, "tumour's share of its half, %", "μ found of the tumour's half, kPa", "without noise")
    for axes in (left, right):
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    left.set_ylim(0.05, None)
    left.axhspan(1.0, 5.0, color="0.9", zorder=0)
    left.annotate("the paper: 1 to 5 %", (share[0], 1.05), fontsize=7, color="0.4", va="bottom")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=len(elements), fontsize=6.5,
                  frameon=False)  # fmt: skip
    return figure


def study_swarm(study: SwarmTable) -> Figure:
    """A panel for some iterations: contours of the objective, particles blue, truth red, as in the paper."""
    shown = study["shown"]
    land = shown["landscape"]
    figure, axes = panels(len(shown["iterations"]), 2.7, 3.0)
    height = np.log10(np.maximum(np.array(land["objective"]), 1e-12))
    for k, (panel, iteration) in enumerate(zip(axes, shown["iterations"], strict=True)):
        panel.contour(land["mu_left_kpa"], land["mu_right_kpa"], height, levels=14, cmap="Greys", linewidths=0.7)
        x = np.array(shown["mu_kpa"][k])
        panel.plot(x[:, 0], x[:, 1], ".", color=OURS, markersize=5, label="particles")
        panel.plot(*study["truth_mu_kpa"], "o", color=PAPER, markersize=5, fillstyle="none", label="truth")
        panel.set_xscale("log")
        panel.set_yscale("log")
        for axis in (panel.xaxis, panel.yaxis):
            axis.set_ticks(_TICKS, [str(t) for t in _TICKS])
            axis.set_minor_formatter(NullFormatter())
        finish(
            panel,
            "μ of the left half, kPa",
            "μ of the right half, kPa" if k == 0 else "",
            f"iteration {iteration}",
            k == 0,
        )
    return figure


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


def study_cohort(study: CohortTable) -> Figure:
    """A box plot for what the organs have, what is found without noise and with, or for a table's values."""
    count = len(study["statistics"])
    figure, axes = panels(count, 2.9 if count > 1 else 4.4, 3.4)
    stages = sorted({row["stage"] for row in study["rows"]})
    for panel, (key, told) in zip(axes, study["statistics"].items(), strict=True):
        groups = [[_value(row, key) for row in study["rows"] if row["stage"] == stage] for stage in stages]
        panel.boxplot(groups, positions=list(range(len(stages))), widths=0.5, medianprops={"color": OURS})
        for k, group in enumerate(groups):
            panel.plot([k] * len(group), group, ".", color="0.4", markersize=4)
        panel.set_xticks(range(len(stages)), [f"T{stage:g}" for stage in stages])
        panel.set_ylim(0.0, 1.3 * max(max(group) for group in groups))
        finish(panel, "stage", "mean μ of the organ, kPa", _WORDS[key], legend=False)
        panel.annotate(
            f"Pearson {told['pearson']:.2f}, p = {told['pearson_p']:.2g}\nSpearman {told['spearman']:.2f}, p = {told['spearman_p']:.2g}",
            (0.03, 0.97), xycoords="axes fraction", fontsize=7, va="top")  # fmt: skip
    paper = study["paper"]
    figure.suptitle(
        f"Patients {study['patients']}\n"
        f"the paper, {paper['patients']} patients: Pearson {paper['pearson']}, Spearman {paper['spearman']}",
        fontsize=8,
    )
    return figure


def _value(row: VirtualPatient | RealPatient, key: str) -> float:
    """Mean mu (kPa) of a patient, of the kind that `statistics` calls by this key."""
    if "mu_kpa" in row:
        return row["mu_kpa"]
    if key == "truth":
        return row["effective_mean_mu_kpa"]
    return row["clean_mean_mu_kpa"] if key == "clean" else row["noisy_mean_mu_kpa"]
