"""One state of a case segmented: here, or in a process beside this one that reads its scan before it is led."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from palpate.case.case_folder import CaseFolder
from palpate.case.contours import Contours, read_contours
from palpate.case.steps.segment_report import SegmentedState
from palpate.core.errors import PalpateError
from palpate.core.worker.executors import one_more_process
from palpate.core.worker.progress import Progress, part, silent
from palpate.imaging.volume import Volume
from palpate.segmentation.pelvis import Segmentation, segment_pelvis
from palpate.segmentation.prompts import Prompts, check_inside
from palpate.segmentation.propagation import CarriedOrgan
from palpate.segmentation.surface_error import surface_errors
from palpate.segmentation.whole_scan import WholeScan, whole_scan

# Organs of the other scan, by name.
Carried = Mapping[str, CarriedOrgan]


@dataclass(frozen=True, eq=False)
class _Read:
    state: str
    contours: Contours | None
    ct: Volume
    whole: WholeScan | None = None


_READ: _Read | None = None


def segmented(
    case: CaseFolder,
    state: str,
    prompts: Prompts,
    model: str | None,
    progress: Progress = silent,
    then: Callable[[Segmentation], None] = lambda _: None,
    carried: Carried | None = None,
    drawn: bool = True,
) -> SegmentedState:
    """then : called with the organs, before the errors of their surfaces are estimated. carried : organs of the other
    scan. drawn : whether a person's contours count.

    Raises InputError for a scan without pelvis or prostate, and for prompts outside of it.
    """
    contours = read_contours(case, state) if drawn else None
    return _segmented(_Read(state, contours, case.ct(state)), prompts, model, progress, then, carried or {})


@contextmanager
def _told_when_it_died() -> Iterator[None]:
    try:
        yield
    except BrokenProcessPool as died:
        raise PalpateError(
            "the process that segments the deformed scan died, perhaps for lack of memory; try `--workers 1`"
        ) from died


class Beside:
    """A state segmented in another process, which begins at once with what needs no prompts."""

    def __init__(self, case: CaseFolder, state: str, pool: Executor, drawn: bool = True) -> None:
        self._pool, self._reading = pool, pool.submit(_read, str(case.path), state, drawn)
        self._made: Future[SegmentedState] | None = None

    def begin(self, prompts: Prompts, model: str | None, carried: Carried) -> None:
        """Lets it go on with these prompts and organs of the other scan. PalpateError where the other process died."""
        with _told_when_it_died():
            self._made = self._pool.submit(_segment_what_was_read, prompts, model, carried)

    def result(self) -> SegmentedState:
        """As `segmented`; PalpateError too where the other process died. Precondition: `begin`."""
        assert self._made is not None
        with _told_when_it_died():
            self._reading.result()
            return self._made.result()


@contextmanager
def segmented_beside(case: CaseFolder, state: str, drawn: bool = True) -> Iterator[Beside]:
    """Ends the other process with the block."""
    pool = one_more_process()
    try:
        yield Beside(case, state, pool, drawn)
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _read(folder: str, state: str, drawn: bool) -> None:
    global _READ
    case = CaseFolder(Path(folder))
    contours, ct = read_contours(case, state) if drawn else None, case.ct(state)
    _READ = _Read(state, contours, ct)
    _READ = _Read(state, contours, ct, whole_scan(ct))


def _segment_what_was_read(prompts: Prompts, model: str | None, carried: Carried) -> SegmentedState:
    assert _READ is not None
    made = _segmented(_READ, prompts, model, silent, lambda _: None, carried)
    _ = made.segmentation.bones  # found here, and kept in what is sent
    return made


def _segmented(
    read: _Read,
    prompts: Prompts,
    model: str | None,
    progress: Progress,
    then: Callable[[Segmentation], None],
    carried: Carried,
) -> SegmentedState:
    contours, ct = read.contours, read.ct
    check_inside(ct, prompts, read.state)
    drawn = contours.organs if contours else {}
    placed = {name: organ.found for name, organ in carried.items()}
    segmentation = segment_pelvis(ct, prompts, drawn, part(progress, 0.0, 0.6), model, read.whole, placed)
    then(segmentation)
    progress(0.6, "how far the surfaces may be off")
    errors = surface_errors(segmentation.scene, prompts, segmentation.organs)
    errors |= {name: organ.errors for name, organ in carried.items()}
    # A person's voxels are written unchanged, on their own grid; segmented structures on the grid of the segmentation.
    by_hand = contours is not None and "prostate" in contours.organs
    grid = contours.volume if contours is not None and by_hand else segmentation.scene.grid
    return SegmentedState(segmentation, contours, grid, errors)
