"""The curve of a plan: how well each region's stiffness would be known over the size of the deformation."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from palpate.ui.pictures.colours import region_hex

if TYPE_CHECKING:
    from palpate.case.steps.plan import PlanRecord

_LOOKS = {"prostate_left": ("o", "-"), "prostate_right": ("s", "--")}


def plan_curve(plan: PlanRecord) -> Figure:
    """plan : what plan.json says. The line at 0.2 is where a stiffness is known to about a fifth."""
    figure = Figure(figsize=(5.2, 3.4), layout="constrained")
    axes = figure.subplots()
    rows = [(row["amount"], row["sd_ln_G"]) for row in plan["rows"] if row["sd_ln_G"] is not None]
    amounts = [amount for amount, _ in rows]
    for name in rows[0][1]:
        marker, line = _LOOKS.get(name, ("^", ":"))
        assumed = plan["assumed_G_kpa"][name]
        axes.plot(amounts, [sd[name] for _, sd in rows], color=region_hex(name), marker=marker, linestyle=line,
                  label=f"{name.replace('_', ' ')} (G = {assumed:.3g} kPa assumed)")  # fmt: skip
    axes.axhline(0.2, color="0.6", linewidth=0.8)
    axes.annotate("known to a fifth", (amounts[-1], 0.2), ha="right", va="bottom", fontsize=7, color="0.4")
    axes.set_yscale("log")
    axes.set_ylim(0.03, 2.0)
    axes.set_yticks([0.05, 0.1, 0.2, 0.5, 1.0], ["0.05", "0.1", "0.2", "0.5", "1"])
    axes.set_xlabel(f"{plan['what']} [{plan['unit']}]", fontsize=8)
    axes.set_ylabel("predicted standard deviation of ln G", fontsize=8)
    axes.set_title(f"contour noise {plan['noise_sd_mm']:g} mm; research use only", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.3, which="both")
    axes.legend(fontsize=7)
    return figure
