"""The picture of `validate cohort`: stiffness by stage, the paper's Fig 13."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from palpate.ui.pictures.studies.axes import OURS, finish, panels

if TYPE_CHECKING:
    from palpate.validate.paper.cohort import CohortTable, RealPatient, VirtualPatient

_WORDS = {"truth": "what it has", "clean": "found without noise", "noisy": "found with noise", "table": "of the table"}


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
