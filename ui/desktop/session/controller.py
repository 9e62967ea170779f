"""The window's logic, without a toolkit: what is open, how it is shown, what is being done, and what a person may do
next.

Widgets call its methods and are told by name what has changed: "case", "labels", "results", "view", "tools", "job",
"steps", "said", "measured", "drawn" (a shape that is being drawn), "choice" (`offered`). All calls come from one thread; work is done by
`jobs.JobControl` in other processes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from palpate.case.case_folder import STATES
from palpate.case.measured.measurements import REGIONS
from palpate.core.errors import InputError
from palpate.imaging.volume import Volume
from palpate.ui.desktop.session import steps
from palpate.ui.desktop.session.display import OVER_LABELS, PAINTS, SCALES, Display
from palpate.ui.desktop.session.drawing import Drawing
from palpate.ui.desktop.session.editing import Editing
from palpate.ui.desktop.session.jobs import JobControl
from palpate.ui.desktop.session.measuring import Measuring
from palpate.ui.desktop.session.open_case import OpenCase
from palpate.ui.desktop.session.opening import Labels, Opening, Rois, ScanPair
from palpate.ui.desktop.session.out_of_date import OutOfDateCheck
from palpate.ui.desktop.session.read_scans import Offered, Scan
from palpate.ui.desktop.session.recent import remember
from palpate.ui.desktop.session.running import Running
from palpate.ui.pictures.colours import StiffnessScale


class Controller:
    """case : the open case or None. scans : what has been read of its CTs. jobs : the steps. reader : reading of scans.
    out_of_date_check : which steps are out of date. measuring, drawing : what is measured, and the shape being drawn.

    available : commands of this version. said : the last thing a person was told.
    """

    def __init__(self) -> None:
        self.case: OpenCase | None = None
        self.display = Display()
        self.jobs = JobControl()
        self._opening, self._running = Opening(self), Running(self)
        self.editing, self.out_of_date_check = Editing(self), OutOfDateCheck()
        self.measuring = Measuring(self)
        self.drawing = Drawing(self, self.editing, self.measuring)
        self.available = frozenset(steps.BY_COMMAND)
        self.said = ""
        self._then: tuple[str, ...] = ()
        self.made: dict[str, Path] = {}
        self.listeners: list[Callable[[str], None]] = []

    @property
    def scans(self) -> Mapping[str, Scan]:
        """What has been read of the CTs, by state."""
        return self._opening.scans

    @property
    def reader(self) -> JobControl:
        """Reading of scans and labels."""
        return self._opening.reader

    def notify(self, what: str) -> None:
        """Tells the widgets that something has changed."""
        if what in ("case", "labels"):
            self.measuring.forget_values()
        for listener in self.listeners:
            listener(what)

    def say(self, text: str) -> None:
        """Tells a person something."""
        self.said = text
        self.notify("said")

    def attempt(self, act: Callable[[], object]) -> None:
        """Does what a person asks for, or tells why it cannot be."""
        try:
            act()
        except InputError as error:
            self.say(str(error))

    # Opening

    def open_case(self, path: Path, then: tuple[str, ...] = ()) -> None:
        """Opens a case folder; its scans are read by the worker. then : steps that are run after that where the case lacks their result.

        Raises InputError.
        """
        if self.case is not None and path.exists() and path.samefile(self.case.folder.path):
            self.say(f"{path.name} is open already")
            return
        opened = OpenCase(path)
        self.close()
        self._take(opened)
        folder = opened.folder
        self._opening.read({state: folder.file(f"{state}_ct") for state in STATES if folder.has(f"{state}_ct")})
        self._then = tuple(name for name in then if not folder.has(steps.BY_COMMAND[name].declared.result))

    def open_pair(
        self, rest: Path, deformed: Path, case: Path, labels: Labels = (None, None), then: tuple[str, ...] = ()
    ) -> None:
        """Shows two scans as soon as they are read, then makes their case, with contours of them where there are any.

        then : steps that are run on the case. Raises InputError for paths that are not there.
        """
        pair = ScanPair(rest, deformed, case, labels, then=then)
        pair.check()
        self.close()
        self._opening.begin(pair)
        self.notify("case")

    @property
    def offered(self) -> Offered | None:
        """Series and structures of which a person must choose before the case is made."""
        return self._opening.offered

    def choose(self, series: Mapping[str, str], rois: Mapping[str, Rois]) -> None:
        """Goes on with what was chosen, by state."""
        self._opening.choose(series, rois)

    def choose_nothing(self) -> None:
        """Gives the two scans up."""
        self._opening.give_up()

    def close(self) -> None:
        """Closes the case and stops what runs. Unsaved corrections stay in the case's journal."""
        for control in (self.jobs, self.reader):
            control.cancel()
            control.wait(2.0)
            control.poll()
            control.state = None
        self.out_of_date_check.forget()
        if self.case is not None:
            self.case.save_session()
            self.case.close()
        self._opening.forget()
        self._running.names, self._then = (), ()
        self.case = None
        self.display = Display()
        self.editing.reset()
        self.drawing.reset()
        self.notify("case")

    def quit(self) -> None:
        """Ends everything."""
        self.close()
        self.out_of_date_check.close()
        self._opening.clean_up()

    # What is shown

    def ct(self, state: str) -> Volume | None:
        """The CT of a state in the rest frame, as far as it is read; the deformed one unaligned until the case is made."""
        scan = self.scans.get(state)
        if scan is None:
            return None
        if state == "rest" or self.case is None:
            return scan.volume
        return scan.volume.moved(self.case.deformed_to_rest)

    def labels(self, state: str) -> Volume | None:
        """The label volume of a state, with all corrections; None where there is none yet."""
        return None if self.case is None else self.case.volumes.get(state)

    def show(self, **changes: object) -> None:
        """Changes how the case is shown: fields of `Display`."""
        for name, value in changes.items():
            setattr(self.display, name, value)
        if "tool" in changes:
            self.drawing.reset()
            self._uncover(self.display.tool)
        self.notify("tools" if set(changes) <= {"tool", "label", "radius_mm", "seed_name"} else "view")

    def _uncover(self, tool: str) -> None:
        """Shows what a tool works on: labels to whoever paints them, the map to whoever measures on it."""
        display = self.display
        if tool in PAINTS and display.overlay in OVER_LABELS:
            self.show(overlay="labels")
        elif tool in REGIONS and self.case is not None and self.case.stiffness_map is not None:
            self.show(overlay="map", mode="rest" if display.mode == "deformed" else display.mode)

    @property
    def scale(self) -> StiffnessScale:
        """Colours of stiffness that were chosen; the same for every patient."""
        return replace(SCALES[self.display.scale], colours=self.display.colours)

    def look_at(self, x: float, y: float, z: float) -> None:
        """Moves the crosshair to patient coordinates, mm LPS."""
        self.show(crosshair=(float(x), float(y), float(z)))

    # Doing

    def steps(self) -> list[steps.StepState]:
        """Where the case is on the way to its report."""
        path = None if self.case is None else self.case.folder.path
        edited = self.case is not None and self.case.corrections.unsaved
        return steps.step_states(path, self.available, edited, self.out_of_date_check.reasons)

    def out_of_date(self, command: str) -> str:
        """Why what a step has made is out of date; empty where it is not, or there is nothing yet."""
        found = [s for s in self.steps() if s.step.command == command and s.state == steps.OUT_OF_DATE]
        return found[0].reason if found else ""

    def run(self, *names: str) -> None:
        """Runs steps one after the other in the worker; corrections are saved before. Raises InputError when they
        cannot run.
        """
        self._running.start(names)

    def go_on(self) -> None:
        """Runs the steps that were asked for when the case was opened, once; not where a person has started one meanwhile."""
        names, self._then = self._then, ()
        if names and self.case is not None and not self.jobs.running:
            self._running.start(names)

    def export(self, form: str, folder: Path) -> None:
        """Writes the case in one of the forms of `palpate export` into a folder. Raises InputError when it cannot."""
        self._running.export(form, folder)

    def touch(self) -> None:
        """Makes the organ ready to be touched; `take_made` has it in the end. Raises InputError when it cannot."""
        self._running.touch()

    def drop(self, film: Path) -> None:
        """Films the organ's fall; `take_made` has the film in the end. Raises InputError when it cannot."""
        self._running.drop(film)

    def take_made(self) -> dict[str, Path]:
        """What a job has made outside of the case, by what it is: "body", "film"; each is told once."""
        made, self.made = self.made, {}
        return made

    def cancel(self) -> None:
        """Stops what runs."""
        self.jobs.cancel()
        self.reader.cancel()
        self.notify("job")

    def save(self) -> None:
        """Writes corrected labels into the case."""
        if self.case is not None and self.case.volumes:
            self.case.save_labels()
            self.case.save_session()
            self.out_of_date_check.start(self.case)
            self.notify("labels")

    def poll(self) -> None:
        """Called every few tens of milliseconds: takes in what jobs tell. Never waits."""
        if self.reader.poll():
            self._opening.told()
        if self.jobs.poll():
            self._running.told()
        if self.out_of_date_check.poll():
            self.notify("steps")
        if self.case is not None and self.case.failures:
            self.say(self.case.failures.pop())

    def take_in(self, done: bool, labels: bool) -> str:
        """Reads what a job has written; in words, where there is something to say.

        done : whether it came to its end. labels : whether it may have written labels. Raises InputError for damaged
        files.
        """
        pair = self._opening.pair
        if self.case is not None:
            self._take_results(self.case, labels)
        elif pair is not None and done:
            kept = self.display.crosshair
            self._take(OpenCase(pair.case))
            self.display.crosshair = kept
            self._opening.read({})
            self._then = pair.then
            return "the case is made; both scans lie in one frame, aligned on bone"
        elif pair is not None:
            self._opening.pair = None
        return ""

    # Inside

    def _take(self, opened: OpenCase) -> None:
        self.case, self.display = opened, opened.display
        remember(opened.folder.path)
        self.out_of_date_check.start(opened)
        if not opened.has_session and opened.regions:
            self._show_stiffness()
        self.notify("case")

    def _take_results(self, case: OpenCase, labels: bool) -> None:
        had_result = bool(case.regions)
        if labels:
            self._opening.read({})
        self.out_of_date_check.start(case)
        case.read_results()
        if case.regions and not had_result:
            self._show_stiffness()
        self.notify("case")

    def _show_stiffness(self) -> None:
        # Opaque enough for the colours to be those of the bar.
        self.display.overlay, self.display.opacity = "stiffness", max(self.display.opacity, 0.7)
