"""What the segment step takes from the scan that it reads first to the other one: organs, or a place."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from palpate.case.case_folder import STATES, CaseFolder
from palpate.case.contours import Contours, read_contours
from palpate.case.steps.segment_options import SegmentOptions
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.statistics import rms
from palpate.core.worker.progress import Progress
from palpate.segmentation.pelvis import Segmentation
from palpate.segmentation.prompts import ORGANS, Prompts
from palpate.segmentation.propagation import CarriedOrgan, carried_organs

# Standard deviation of an organ's displacement between the scans, where only the scan at rest has a click.
CARRIED_SD_MM = 8.0
_IN_WORDS = {"rest": "the scan at rest", "deformed": "the deformed scan"}


@dataclass(eq=False)
class OtherScan:
    """order : states as they are segmented; the second is led by the first. names : organs that are to be carried over, and
    after `carried` those that were. notes : for the user."""

    case: CaseFolder
    options: SegmentOptions
    order: tuple[str, str]
    drawn: Contours | None
    names: tuple[str, ...]
    notes: list[str] = field(default_factory=list)
    _found: dict[str, CarriedOrgan] = field(default_factory=dict)

    @classmethod
    def of(cls, case: CaseFolder, options: SegmentOptions, drawn: bool = True) -> OtherScan:
        """The scan in which a prostate was drawn leads, the one at rest where both or none have one. drawn : whether a
        person's contours count.
        """
        contours = {state: read_contours(case, state) if drawn else None for state in STATES}
        organs = {state: set(known.organs) if known else set() for state, known in contours.items()}
        first = "deformed" if "prostate" in organs["deformed"] - organs["rest"] and case.has("deformed_ct") else "rest"
        second = STATES[1 - STATES.index(first)]
        free = prompts_of(case, options, second)
        wanted = [n for n in ORGANS if n not in organs[second] and free.mode(n) == "auto"]
        asked = options.propagate and options.model is None and case.has(f"{second}_ct")
        return cls(case, options, (first, second), contours[first], tuple(wanted) if asked else ())

    def prompts(self, first: Segmentation) -> Prompts:
        """What a person pointed at in the other scan, and the place of the prostate in this one."""
        own = prompts_of(self.case, self.options, self.order[1])
        return own.or_near(_centroids(first), CARRIED_SD_MM)

    def carried(self, first: Segmentation, progress: Progress) -> dict[str, CarriedOrgan]:
        """Organs of the first scan that nobody drew or pointed at in the other one, for that one; none where both scans do not
        look alike."""
        if not self.names:
            return {}
        scans = self.case.ct(self.order[0]), self.case.ct(self.order[1])
        try:
            drawn = {} if self.drawn is None else self.drawn.organs
            found = carried_organs(first, drawn, self.names, scans, progress)
        except InputError as error:
            found, why = None, str(error)
        else:
            why = "the two CTs do not look alike about the organs"
        if found is None:
            self.notes.append(f"{self.order[1]}: no contour was carried over, it is segmented by itself: {why}")
        self._found, self.names = found or {}, tuple(found or ())
        self.notes += [_note(self.order, self._found)] if self._found else []
        return self._found


def prompts_of(case: CaseFolder, options: SegmentOptions, state: str) -> Prompts:
    """What a person pointed at in a scan, in the rest frame."""
    return options.prompts if state == "rest" else options.prompts_deformed.moved(case.deformed_to_rest())


def _centroids(found: Segmentation) -> dict[str, FloatArray]:
    grid = found.scene.grid
    return {
        name: grid.to_lps(np.argwhere(organ.mask).mean(axis=0)[None])[0]
        for name, organ in found.organs.items()
        if name == "prostate"
    }


def _note(order: tuple[str, str], found: dict[str, CarriedOrgan]) -> str:
    each = ", ".join(f"{name} {rms(organ.errors.sd_mm):.1f} mm" for name, organ in found.items())
    return (
        f"{order[1]}: contours were carried over from {_IN_WORDS[order[0]]} by the motion that both CTs show (may be off by, rms: "
        f"{each}); look at them in `palpate open CASE`"
    )
