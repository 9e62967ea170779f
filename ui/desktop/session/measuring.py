"""Measurements on the open case: kept with it at once, and what they say in words."""

from __future__ import annotations

from string import ascii_uppercase

from palpate.case.measured.measurements import (
    REGIONS,
    Measurement,
    Point,
    write_measurements,
)
from palpate.core.errors import InputError
from palpate.ui.desktop.session.session import Session
from palpate.ui.report.measured_regions import YOUNG, MeasuredRegion, line_words, measured_region
from palpate.ui.words.number_words import three_figures


class Measuring:
    """Acts on the case that the session has open."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._values: dict[Measurement, MeasuredRegion] = {}

    @property
    def kept(self) -> tuple[Measurement, ...]:
        """All measurements of the case."""
        case = self._session.case
        return () if case is None else case.measurements

    def forget_values(self) -> None:
        """Labels or map have changed: regions are measured again when they are asked for."""
        self._values.clear()

    def why_not(self, kind: str, state: str) -> str:
        """Why nothing of a kind can be measured on a scan now; empty when it can."""
        case = self._session.case
        if case is None:
            return "measurements are kept with a case; wait till it is made"
        if kind in REGIONS and case.stiffness_map is None:
            return "there is no stiffness map to measure on yet; run Stiffness"
        if kind in REGIONS and state != "rest":
            return "the stiffness map is of the organ at rest; measure on the scan at rest"
        return ""

    def add(self, kind: str, plane: str, points: tuple[Point, ...]) -> Measurement:
        """Keeps a measurement. Raises InputError for an outline that holds no part of the organ."""
        used = {one.name for one in self.kept}
        names = (f"{letter}{number or ''}" for number in range(100) for letter in ascii_uppercase)
        new = Measurement(next(name for name in names if name not in used), kind, plane, points)  # type: ignore[arg-type]
        if kind in REGIONS:
            region = self.region(new)
            if region is None or region.organ_share == 0.0:
                raise InputError("that region contains no part of the organ; draw it on the prostate")
        self._keep((*self.kept, new))
        return new

    def remove(self, name: str) -> None:
        """Takes a measurement away."""
        self._keep(tuple(one for one in self.kept if one.name != name))

    def region(self, measurement: Measurement) -> MeasuredRegion | None:
        """Area, mean and interval of a region; None without labels."""
        labels, case = self._session.labels("rest"), self._session.case
        if labels is None or case is None:
            return None
        if measurement not in self._values:
            self._values[measurement] = measured_region(measurement, labels, case.stiffness_map)
        return self._values[measurement]

    def short_words(self, measurement: Measurement) -> str:
        """Name and value, for the slice."""
        return f"{measurement.name}: {self.value_words(measurement)[0]}"

    def value_words(self, measurement: Measurement) -> tuple[str, ...]:
        """The value, and what belongs to it, part by part."""
        if measurement.kind not in REGIONS:
            return (line_words(measurement),)
        region = self.region(measurement)
        if region is None:
            return ("labels are being read",)
        return _region_words(region, "out of date" if self._session.out_of_date("identify") else "")

    def _keep(self, found: tuple[Measurement, ...]) -> None:
        case = self._session.case
        assert case is not None
        case.measurements = found
        case.later(write_measurements, case.folder, found)
        self._session.notify("measured")


def _region_words(region: MeasuredRegion, old: str) -> tuple[str, ...]:
    area = f"{region.area_mm2:.0f} mm\N{SUPERSCRIPT TWO}"
    inside = "" if region.organ_share > 0.995 else f"{100.0 * region.organ_share:.0f} % of it in the organ"
    mean = region.mean
    if mean.G_kpa is None:
        return tuple(filter(None, ("G not determined", area, inside)))
    told = "" if mean.told_share > 0.995 else f"determined in {100.0 * mean.told_share:.0f} %"
    G = f"G = {three_figures(mean.G_kpa)} kPa"
    more = (f"95 % {region.interval_words}", f"E = {three_figures(YOUNG * mean.G_kpa)} kPa", area, inside, told, old)
    return tuple(filter(None, (G, *more)))
