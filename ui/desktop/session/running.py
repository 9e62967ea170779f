"""Steps at work on the open case: how they are started, and how what they have written is taken in."""

from __future__ import annotations

from pathlib import Path

from palpate.core.errors import InputError
from palpate.ui.desktop.session import export_job, step_job, steps
from palpate.ui.desktop.session.open_case import OpenCase
from palpate.ui.desktop.session.session import Session
from palpate.ui.desktop.session.step_requests import step_request


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
        session = self._session
        if session.case is None:
            raise InputError("no case is open; open two scans or a case first")
        if session.jobs.running:
            raise InputError("a step runs; wait for it or cancel it first")
        if session.case.corrections.unsaved:
            session.save()
        session.case.flush()
        self.names = ()
        job = export_job.export_job(session.case.folder.path, form, folder, session.case.folder.file("desktop/job"))
        session.jobs.start(job, f"Export {form}")
        session.notify("job")

    def _checked(self, names: tuple[str, ...]) -> OpenCase:
        """The case that the steps can run on."""
        session = self._session
        if session.case is None:
            raise InputError("no case is open; open two scans or a case first")
        if session.jobs.running:
            raise InputError("another step runs; wait for it or cancel it first")
        unknown = [name for name in names if name not in session.available or name not in steps.BY_COMMAND]
        if unknown or not names:
            raise InputError(f"there is no step {' '.join(unknown)!r}; give one of {', '.join(steps.BY_COMMAND)}")
        return session.case

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
        files = self._session.jobs.state.result.get("files") if self._session.jobs.state is not None else None
        if outcome == "done" and isinstance(files, list) and files:
            said = f"written: {len(files)} file{'s' * (len(files) > 1)} in {Path(files[0]).parent}"
        try:
            said = self._session.take_in(outcome == "done", "segment" in self.names) or said
        except InputError as damaged:
            said = said or str(damaged)
        if said:
            self._session.say(said)
