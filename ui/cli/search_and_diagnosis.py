"""Search for the stiffness and diagnosis side by side: both start from one plain fit, which the search keeps early."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import TYPE_CHECKING

from palpate.case.matched import wants_image
from palpate.case.steps import diagnose, identify
from palpate.core.diagnose.diagnosis_record import DiagnosisRecord
from palpate.core.errors import Cancelled, ConvergenceError, InputError
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.result_record import ResultRecord
from palpate.core.residual.fit_file import FILE
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Message
from palpate.core.worker.process import run_job
from palpate.ui.cli.console import Console

if TYPE_CHECKING:
    from palpate.case.case_folder import CaseFolder

# What a diagnosis found, or one line that says why there is none.
Diagnosed = DiagnosisRecord | str


def search_and_diagnose(
    case: CaseFolder,
    search: IdentifyOptions,
    look: diagnose.DiagnoseOptions | None,
    console: Console,
    side_by_side: bool,
) -> tuple[ResultRecord, Diagnosed | None]:
    """Result of the search, and of the diagnosis where `look` asks for one: the same ones, whether side by side or not.

    A case that cannot be diagnosed keeps its stiffness. Raises what the search raises; the diagnosis is then stopped.
    """
    if look is not None and look.image is None:  # both stand on the same data; an earlier result.json may say otherwise
        look = replace(look, image=wants_image(case, search.image))
    if look is None or not side_by_side:
        found = _search(case, search, console, lambda: None)
        return found, None if look is None else _diagnose(case, look, console)
    kept, stop = threading.Event(), threading.Event()
    with ThreadPoolExecutor(1) as beside:
        diagnosed: Future[Diagnosed | None] = beside.submit(_diagnose_when, kept, stop, case, look, console)
        ended = False
        try:
            found = _search(case, search, console, kept.set)
            ended = True
        finally:
            if not ended:  # an error, or Ctrl-C: nothing may go on by itself
                stop.set()
            kept.set()
        return found, diagnosed.result()


def _search(case: CaseFolder, options: IdentifyOptions, console: Console, kept: Callable[[], None]) -> ResultRecord:
    """kept : called when the plain fit is in its file."""

    def run_and_tell(job: Job, on_message: Callable[[Message], None]) -> dict[str, object]:
        def told(message: Message) -> None:
            if message["type"] == "checkpoint" and str(message["path"]).endswith(FILE):
                kept()
            on_message(message)

        return run_job(job, told)

    with console.progress("identify") as progress:
        return identify.run(case, options, progress, run_and_tell)


def _diagnose_when(
    kept: threading.Event, stop: threading.Event, case: CaseFolder, options: diagnose.DiagnoseOptions, console: Console
) -> Diagnosed | None:
    """The diagnosis once the fit is kept; None where it was stopped."""
    kept.wait()
    try:
        return None if stop.is_set() else _diagnose(case, options, console, stop)
    except Cancelled:
        if not stop.is_set():
            raise
        return None


def _diagnose(
    case: CaseFolder,
    options: diagnose.DiagnoseOptions,
    console: Console,
    stop: threading.Event | None = None,
) -> Diagnosed:
    try:
        with console.progress("diagnose") as progress:
            return diagnose.run(case, options, progress, lambda job, tell: run_job(job, tell, stop))
    except (ConvergenceError, InputError) as error:
        return f"note    no diagnosis: {error}"
