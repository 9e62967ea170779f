"""The picture of `validate cohort`: stiffness by stage, the paper's Fig 13."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure

from palpate.ui.pictures.studies.axes import OURS, finish, panels

_VALUES = {"truth": ("effective_mean_mu_kpa", "what it has"), "clean": ("clean_mean_mu_kpa", "found without noise"),
           "noisy": ("noisy_mean_mu_kpa", "found with noise"), "table": ("mu_kpa", "of the table")}  # fmt: skip


def study_cohort(study: Mapping[str, Any]) -> Figure:
    """A box plot for what the organs have, what is found without noise and with, or for a table's values."""
    count = len(study["statistics"])
    figure, axes = panels(count, 2.9 if count > 1 else 4.4, 3.4)
    stages = sorted({row["stage"] for row in study["rows"]})
    for panel, (key, told) in zip(axes, study["statistics"].items(), strict=True):
        name, words = _VALUES[key]
        groups = [[row[name] for row in study["rows"] if row["stage"] == stage] for stage in stages]
        panel.boxplot(groups, positions=list(range(len(stages))), widths=0.5, medianprops={"color": OURS})
        for k, group in enumerate(groups):
            panel.plot([k] * len(group), group, ".", color="0.4", markersize=4)
        panel.set_xticks(range(len(stages)), [f"T{stage:g}" for stage in stages])
        panel.set_ylim(0.0, 1.3 * max(max(group) for group in groups))
        finish(panel, "stage", "mean μ of the organ, kPa", words, legend=False)
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
