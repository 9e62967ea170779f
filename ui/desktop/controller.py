"""The window's logic, without a toolkit: what is open, how it is shown, what is being done, and what a person may do next.

Widgets call its methods and are told by name what has changed: "case", "labels", "results", "view", "tools", "job", "steps",
"said".
All calls come from one thread; work is done by `jobs.JobControl` in other processes.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from palpate.core.errors import InputError
from palpate.segmentation.case import STATES
from palpate.segmentation.labels import LABELS, ORGAN_LABELS
from palpate.segmentation.volume import Volume
from palpate.ui.cli.main import COMMANDS
from palpate.ui.desktop import commands, overlay, steps
from palpate.ui.desktop.display import Display
from palpate.ui.desktop.editing import Editing
from palpate.ui.desktop.freshness import Freshness
from palpate.ui.desktop.jobs import JobControl
from palpate.ui.desktop.open_case import OpenCase
from palpate.ui.desktop.recent import remember
from palpate.ui.desktop.scans import Scan, mapped_labels, mapped_scan
from palpate.ui.pictures.planes import centre_of

# Files with contours of the scan at rest and of the deformed one.
Labels = tuple[Path | None, Path | None]


class Controller:
    """case : the open case or None. scans : what has been read of its CTs. jobs : the steps. reader : reading of scans.
    freshness : which steps are out of date.

    available : commands of this version. said : the last thing a person was told.
    """

    def __init__(self) -> None:
        self.case: OpenCase | None = None
        self.scans: dict[str, Scan] = {}
        self.display = Display()
        self.jobs, self.reader = JobControl(), JobControl()
        self.editing, self.freshness = Editing(self), Freshness()
        self.available = frozenset(COMMANDS)
        self.said = ""
        self.listeners: list[Callable[[str], None]] = []
        self._scratch = Path(tempfile.mkdtemp(prefix="palpate-window-"))
        self._pair: tuple[Path, Path, Path, Labels] | None = None
        self._scratch_number = 0
        self._running: tuple[str, ...] = ()

    def notify(self, what: str) -> None:
        """Tells the widgets that something has changed."""
        for listener in self.listeners:
            listener(what)

    def say(self, text: str) -> None:
        """Tells a person something."""
        self.said = text
        self.notify("said")

    # Opening

    def open_case(self, path: Path) -> None:
        """Opens a case folder; its scans are read by the worker. Raises InputError."""
        opened = OpenCase(path)
        self.close()
        self._take(opened)
        self._read({state: opened.folder.file(f"{state}_ct") for state in STATES if opened.folder.has(f"{state}_ct")})

    def open_pair(self, rest: Path, deformed: Path, case: Path, labels: Labels = (None, None)) -> None:
        """Shows two scans as soon as they are read, then makes their case, with contours of them where there are any.

        Raises InputError for paths that are not there.
        """
        for path in labels:
            if path is not None and not path.is_file():
                raise InputError(f"{path} is not there; choose the file that holds the contours")
        for path in (rest, deformed):
            if not path.exists():
                raise InputError(f"{path} is not there; choose the folder that holds the slices of the CT")
        self.close()
        self._pair = (rest, deformed, case, labels)
        if rest.is_dir() and deformed.is_dir():
            self._read({"rest": rest, "deformed": deformed})
        else:
            self._import()
        self.notify("case")

    def close(self) -> None:
        """Closes the case and stops what runs. Unsaved corrections stay in the case's journal."""
        for control in (self.jobs, self.reader):
            control.cancel()
            control.wait(2.0)
            control.poll()
            control.state = None
        self.freshness.forget()
        if self.case is not None:
            self.case.save_session()
            self.case.close()
        self.case, self.scans, self._pair, self._running = None, {}, None, ()
        self.display = Display()
        self.editing.reset()
        self.notify("case")

    def quit(self) -> None:
        """Ends everything."""
        self.close()
        self.freshness.close()
        shutil.rmtree(self._scratch, ignore_errors=True)

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

    def value_at_crosshair(self) -> str:
        """HU, label and stiffness where the crosshair is, in words."""
        state = "deformed" if self.display.mode == "deformed" else "rest"
        at = np.array([self.display.crosshair])
        words = []
        hu, label = _voxel(self.ct(state), at), _voxel(self.labels(state), at)
        if hu is not None:
            words.append(f"{hu:.0f} HU".replace("-", "\N{MINUS SIGN}"))
        if label is not None:
            words.append(LABELS[int(label)].replace("_", " "))
            words += self._stiffness_words(int(label), state, at)
        return ", ".join(words)

    def _stiffness_words(self, label: int, state: str, at: np.ndarray) -> list[str]:
        """What is known of the stiffness at a point (1, 3) mm of a label: by the map where that is shown, else of the region."""
        case, display = self.case, self.display
        if case is None or label not in ORGAN_LABELS:
            return []
        old = ["out of date"] if self.out_of_date("identify") else []
        if display.overlay == "map" and case.stiffness_map is not None and state == "rest":
            (G,), (told,) = overlay.map_at(case.stiffness_map, at, display.surest_factor)
            return [f"G here = {G:.3g} kPa", *old] if told else ["the map does not tell G here"]
        whole = "of the half " if display.overlay == "map" and len(case.regions) > 1 else ""
        found = [r for r in case.regions if r.label == label]
        return [f"G {whole}= {r.G:.3g} kPa" if r.told else "stiffness not told" for r in found] + (old if found else [])

    def show(self, **changes: Any) -> None:
        """Changes how the case is shown: fields of `Display`."""
        for name, value in changes.items():
            setattr(self.display, name, value)
        self.notify("tools" if set(changes) <= {"tool", "label", "radius_mm", "seed_name"} else "view")

    def look_at(self, x: float, y: float, z: float) -> None:
        """Moves the crosshair to patient coordinates, mm LPS."""
        self.show(crosshair=(float(x), float(y), float(z)))

    # Doing

    def steps(self) -> list[steps.StepState]:
        """Where the case is on the way to its report."""
        path = None if self.case is None else self.case.folder.path
        edited = self.case is not None and self.case.corrections.unsaved
        return steps.step_states(path, self.available, edited, self.freshness.reasons)

    def out_of_date(self, command: str) -> str:
        """Why what a step has made is out of date; empty where it is not, or there is nothing yet."""
        found = [s for s in self.steps() if s.step.command == command and s.state == steps.OUT_OF_DATE]
        return found[0].reason if found else ""

    def run(self, *names: str) -> None:
        """Runs steps one after the other in the worker; corrections are saved before. Raises InputError when they cannot run."""
        if self.case is None:
            raise InputError("no case is open; open two scans or a case first")
        if self.jobs.running:
            raise InputError("another step runs; wait for it or cancel it first")
        unknown = [name for name in names if name not in self.available or name not in steps.BY_COMMAND]
        if unknown or not names:
            raise InputError(f"there is no step {' '.join(unknown)!r}; give one of {', '.join(steps.BY_COMMAND)}")
        if self.case.corrections.unsaved:
            self.save()
        self.case.save_session()
        self.case.flush()
        if "segment" in names:
            self.case.keep_corrected()
        folder, align = self.case.folder, self.case.deformed_to_rest
        self._running = names
        self.say("")
        asked = [commands.step_command(name, folder.path, self.case.seeds, align) for name in names]
        self.jobs.start(commands.steps_job(asked, folder.file("desktop/job")), steps.BY_COMMAND[names[0]].title)
        self.notify("job")

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
            self.freshness.start(self.case)
            self.notify("labels")

    def poll(self) -> None:
        """Called every few tens of milliseconds: takes in what jobs tell. Never waits."""
        if self.reader.poll():
            self._reader_told()
        if self.jobs.poll():
            self._job_told()
        if self.freshness.poll():
            self.notify("steps")
        if self.case is not None and self.case.failures:
            self.say(self.case.failures.pop())

    # Inside

    def _take(self, opened: OpenCase) -> None:
        self.case, self.display = opened, opened.display
        remember(opened.folder.path)
        self.freshness.start(opened)
        if not opened.has_session and opened.regions:
            self._show_stiffness()
        self.notify("case")

    def _centre(self) -> None:
        """Crosshair into the organ, or the middle of what there is."""
        labels, ct = self.labels("rest"), self.ct("rest")
        volume = labels if labels is not None else ct
        if volume is not None:
            self.display.crosshair = _inside(volume, labels is not None)

    def _read(self, sources: dict[str, Path]) -> None:
        """Starts reading scans, and the labels of the open case."""
        self._scratch_number += 1
        case = None if self.case is None else self.case.folder.path
        job = commands.scans_job(sources, case, self._scratch / f"read{self._scratch_number}")
        self.reader.start(job, "Reading the scans" if sources else "Reading the labels")
        self.notify("job")

    def _import(self) -> None:
        assert self._pair is not None
        job = commands.steps_job([commands.import_command(*self._pair)], self._scratch / "import")
        self.jobs.start(job, steps.BY_COMMAND["import"].title)
        self.notify("job")

    def _reader_told(self) -> None:
        state = self.reader.state
        assert state is not None
        while state.found:
            self._found(state.found.pop(0))
        if state.outcome == "done" and self._pair is not None and self.case is None:
            self._import()
        elif state.outcome in ("failed", "cancelled"):
            self._pair = None if self.case is None else self._pair
            self.say(state.error or "reading was cancelled")
        self.notify("job")

    def _found(self, found: dict[str, Any]) -> None:
        """Takes in a scan, or the labels, that have been read."""
        had_labels = self.labels("rest") is not None
        if "scan" in found:
            self.scans[found["scan"]["state"]] = mapped_scan(found["scan"])
        elif self.case is not None:
            told = found["labels"]
            volumes = {state: mapped_labels(one) for state, one in told.items()}
            self.case.take_labels(volumes, {state: one["hash"] for state, one in told.items()})
            if self.case.corrections.unsaved:
                self.say("corrections that had not been saved are back; save them or undo them")
        new = not had_labels and self.labels("rest") is not None
        if (new or self.labels("rest") is None) and not (self.case is not None and self.case.has_session):
            self._centre()
        self.notify("case")

    def _job_told(self) -> None:
        state = self.jobs.state
        assert state is not None
        if not state.running:
            self._job_ended(state.outcome, state.error)
        self.notify("job")

    def _job_ended(self, outcome: str, error: str) -> None:
        said = error if outcome == "failed" else ""
        if outcome == "cancelled":
            said = "cancelled; run the step again to go on from where it stopped"
        try:
            said = self._take_in(outcome) or said
        except InputError as damaged:
            said = said or str(damaged)
        if said:
            self.say(said)

    def _take_in(self, outcome: str) -> str:
        """What a job has written; in words, where there is something to say."""
        if self.case is None and self._pair is not None:
            if outcome != "done":
                self._pair = None
                return ""
            kept = self.display.crosshair
            self._take(OpenCase(self._pair[2]))
            self.display.crosshair = kept
            self._read({})
            return "the case is made; both scans lie in one frame, aligned on bone"
        if self.case is not None:
            had_result = bool(self.case.regions)
            if "segment" in self._running:
                self._read({})
            self.freshness.start(self.case)
            self.case.read_results()
            if self.case.regions and not had_result:
                self._show_stiffness()
            self.notify("case")
        return ""

    def _show_stiffness(self) -> None:
        # Opaque enough for the colours to be those of the bar.
        self.display.overlay, self.display.opacity = "stiffness", max(self.display.opacity, 0.7)


def _voxel(volume: Volume | None, at: np.ndarray) -> float | None:
    """The value of the voxel that holds a point (1, 3) mm; None outside."""
    if volume is None:
        return None
    index = np.rint(volume.to_index(at)[0]).astype(int)
    inside = (index >= 0).all() and (index < volume.array.shape).all()
    return float(volume.array[tuple(index)]) if inside else None


def _inside(volume: Volume, labelled: bool) -> tuple[float, float, float]:
    """The middle of the organ in labels, but of its larger half from side to side; without labels of the whole grid."""
    if labelled:
        # Into the larger half: where the halves meet a sagittal slice shows neither.
        halves = [label for label in ORGAN_LABELS if (volume.array == label).any()]
        larger = max(halves, key=lambda label: int((volume.array == label).sum()), default=ORGAN_LABELS[0])
        x, y, z = (float(c) for c in centre_of(volume, ORGAN_LABELS))
        x = float(centre_of(volume, (larger,))[0])
    else:
        x, y, z = (float(c) for c in volume.to_lps((np.array([volume.array.shape]) - 1) / 2.0)[0])
    return x, y, z
