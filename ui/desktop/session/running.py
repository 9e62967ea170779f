"""Steps at work on the open case: how they are started, and how what they have written is taken in."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path

from palpate.core.errors import InputError
from palpate.core.worker.job import Job
from palpate.ui.desktop.session import beside_jobs, step_job, steps
from palpate.ui.desktop.session.open_case import OpenCase
from palpate.ui.desktop.session.session import Session
from palpate.ui.desktop.session.step_requests import step_request
from palpate.ui.words.number_words import duration


class Running:
    """Acts on the session's `jobs`. names : the steps started last."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self.names: tuple[str, ...] = ()

    def start(self, names: tuple[str, ...]) -> None:
        """Runs steps one after the other; corrections are saved before. Raises InputError when they cannot run."""
        session, case = self._session, self._checked(names)
        if case.corrections.unsaved:
            session.save()
        case.save_session()
        case.flush()
        if "segment" in names:
            case.keep_corrected()
        self.names = names
        session.say("")
        requests = [step_request(name, case.folder.path, case.seeds, case.deformed_to_rest) for name in names]
        job = step_job.steps_job(requests, case.folder.file("desktop/job"))
        session.jobs.start(job, steps.BY_COMMAND[names[0]].title)
        session.notify("job")

    def export(self, form: str, folder: Path) -> None:
        """Writes the case in one form for other programs. Raises InputError when no case is open or a step runs."""
        case = self._idle()
        if case.corrections.unsaved:
            self._session.save()
        self._start_beside(
            case, beside_jobs.export_job(case.folder.path, form, folder, _scratch(case)), f"Export {form}"
        )

    def touch(self) -> None:
        """Makes the organ ready to be touched. Raises InputError when no case is open, it has no stiffness, or a step runs."""
        case = self._identified()
        self._start_beside(case, beside_jobs.body_job(case.folder.path, _scratch(case)), "Touch")

    def drop(self, film: Path) -> None:
        """Films the organ's fall. Raises InputError as `touch` does, and for a film that is no .mp4."""
        case = self._identified()
        if film.suffix.lower() != ".mp4":
            raise InputError(f"{film}: a film is a file whose name ends in .mp4; choose another name")
        self._start_beside(
            case, beside_jobs.film_job(case.folder.path, film.absolute(), _scratch(case)), "Film of the fall"
        )

    def _start_beside(self, case: OpenCase, job: Job, title: str) -> None:
        """Starts a job that is no step of the case."""
        case.flush()
        self.names = ()
        self._session.say("")
        self._session.jobs.start(job, title)
        self._session.notify("job")

    def _idle(self) -> OpenCase:
        """The open case while nothing runs."""
        session = self._session
        if session.case is None:
            raise InputError("no case is open; open two scans or a case first")
        if session.jobs.running:
            raise InputError("another step runs; wait for it or cancel it first")
        return session.case

    def _identified(self) -> OpenCase:
        case = self._idle()
        if not case.regions:
            raise InputError("no stiffness has been found yet; run Stiffness first")
        return case

    def _checked(self, names: tuple[str, ...]) -> OpenCase:
        """The case that the steps can run on."""
        session, case = self._session, self._idle()
        unknown = [name for name in names if name not in session.available or name not in steps.BY_COMMAND]
        if unknown or not names:
            raise InputError(f"there is no step {' '.join(unknown)!r}; give one of {', '.join(steps.BY_COMMAND)}")
        return case

    def told(self) -> None:
        """Takes in what the job has told."""
        state = self._session.jobs.state
        assert state is not None
        if not state.running:
            self._ended(state.outcome, state.error)
        self._session.notify("job")

    def _ended(self, outcome: str, error: str) -> None:
        said = error if outcome == "failed" else ""
        if outcome == "cancelled":
            said = "cancelled; run the step again to go on from where it stopped"
        if outcome == "done":
            said = self._made(self._session.jobs.state.result if self._session.jobs.state is not None else {})
        try:
            said = self._session.take_in(outcome == "done", "segment" in self.names) or said
        except InputError as damaged:
            said = said or str(damaged)
        state = self._session.jobs.state
        if outcome == "done" and not said and state is not None:
            said = f"{state.name} is done; it took {duration(state.seconds_since(time.monotonic()))}"
        if said:
            self._session.say(said)
        if outcome == "done":
            self._session.go_on()

    def _made(self, result: Mapping[str, object]) -> str:
        """Takes note of what a job has made outside of the case; in words, where there is something to say."""
        files = result.get("files")
        if isinstance(files, list) and files:
            return f"written: {len(files)} file{'s' * (len(files) > 1)} in {Path(files[0]).parent}"
        self._session.made = {kind: Path(str(result[kind])) for kind in ("body", "film") if kind in result}
        return f"written: {result['film']}" if "film" in result else ""


def _scratch(case: OpenCase) -> Path:
    return case.folder.file("desktop/job")
