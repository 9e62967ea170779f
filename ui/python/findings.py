"""What was found, as a person at a prompt wants it: a short text, a table, a plot. Nothing here writes a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from palpate.core.diagnose.diagnosis_record import DiagnosisRecord
from palpate.core.identify.result_record import IdentificationRecord, RegionRecord, ResultRecord
from palpate.ui.words.number_words import three_figures

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Room beside the outermost ends of intervals, a factor: at least one round figure of 1, 2 and 5 lies on the axis then.
_FREE = 1.6

Row = dict[str, str | float | None]


@dataclass(frozen=True, eq=False, repr=False)
class Stiffness:
    """record : everything that was found, as in result.json."""

    record: IdentificationRecord | ResultRecord

    @property
    def regions(self) -> Mapping[str, RegionRecord]:
        """Region name -> its stiffness, kPa."""
        return self.record.parameters

    @property
    def G_kpa(self) -> dict[str, float]:
        """Region name -> shear modulus, kPa."""
        return {name: region.G_kpa for name, region in self.regions.items()}

    @property
    def interval_kpa(self) -> dict[str, tuple[float, float] | None]:
        """Region name -> 95 % interval of G, kPa; None where it is not known."""
        return {name: region.ci95_kpa for name, region in self.regions.items()}

    def table(self) -> list[Row]:
        """One row a region: region, G_kpa, low_kpa, high_kpa (95 % interval), at_bound. `pandas.DataFrame` takes it as it is."""
        rows: list[Row] = []
        for name, region in self.regions.items():
            low, high = region.ci95_kpa or (None, None)
            rows.append(
                {"region": name, "G_kpa": region.G_kpa, "low_kpa": low, "high_kpa": high, "at_bound": region.at_bound}
            )
        return rows

    def plot(self, axes: Axes | None = None) -> Axes:
        """A point and its 95 % interval for every region, logarithmic in kPa. axes : of matplotlib, new where None."""
        from matplotlib import pyplot  # here, because it costs a second

        from palpate.ui.pictures.published_scale import kpa_axis

        shown = pyplot.subplots(figsize=(5.0, 1.0 + 0.5 * len(self.regions)))[1] if axes is None else axes
        for row, (name, region) in enumerate(self.regions.items()):
            low, high = region.ci95_kpa or (region.G_kpa, region.G_kpa)
            shown.plot([low, high], [row, row], color="#31688e", linewidth=2)
            shown.plot(region.G_kpa, row, "o", color="#31688e", label=name)
            shown.annotate(
                three_figures(region.G_kpa), (region.G_kpa, row), (0.0, 6.0), textcoords="offset points", ha="center"
            )
        shown.set_yticks(range(len(self.regions)), [name.replace("_", " ") for name in self.regions])
        shown.set_ylim(len(self.regions) - 0.4, -0.7)  # the first region above
        kpa_axis(shown)
        ends = [kpa for region in self.regions.values() for kpa in region.ci95_kpa or (region.G_kpa,)]
        shown.set_xlim(min(ends) / _FREE, max(ends) * _FREE)
        shown.set_xlabel("shear modulus G, kPa")
        shown.set_title("value and 95 % interval", fontsize="medium")
        shown.grid(axis="x", alpha=0.35)
        return shown

    def __repr__(self) -> str:
        lines = []
        for name, region in self.regions.items():
            interval = (
                "interval not known"
                if region.ci95_kpa is None
                else f"95 % {region.ci95_kpa[0]:.3g} to {region.ci95_kpa[1]:.3g}"
            )
            edge = ", at the edge of what was allowed" if region.at_bound else ""
            lines.append(f"{name}: G = {region.G_kpa:.3g} kPa, {interval}{edge}")
        lines.append(f"misfit {self.record.misfit.rms_mm:.2f} mm rms; {self.record.identifiability.verdict}")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False, repr=False)
class Gap:
    """record : everything that the diagnosis says, as in diagnosis.json."""

    record: DiagnosisRecord

    @property
    def verdict(self) -> str:
        """ "none", an effect, "ambiguous" or "unknown"."""
        return self.record.verdict

    def table(self) -> list[Row]:
        """One row an effect, likeliest first: effect, probability, p_value."""
        return [{"effect": e.effect, "probability": e.probability, "p_value": e.p_value} for e in self.record.ranking]

    def plot(self, axes: Axes | None = None) -> Axes:
        """The probability of every effect. axes : of matplotlib, new where None."""
        from matplotlib import pyplot  # here, because it costs a second

        rows = self.table()[::-1]
        shown = pyplot.subplots(figsize=(5.0, 1.0 + 0.3 * len(rows)))[1] if axes is None else axes
        shown.barh(
            [str(row["effect"]) for row in rows], [float(row["probability"] or 0.0) for row in rows], color="#31688e"
        )
        shown.set_xlim(0.0, 1.0)
        shown.set_xlabel("probability")
        return shown

    def __repr__(self) -> str:
        gap = self.record.gap
        told = f"verdict: {self.verdict} (p = {gap.p_value:.3g}); gap {gap.rms_mm:.2f} mm rms, noise floor {gap.noise_floor_mm:.2f} mm"
        candidates = f"\ncandidates: {', '.join(self.record.candidates)}" if self.record.candidates else ""
        return told + candidates
