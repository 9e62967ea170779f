"""A job that runs commands of the command line, one after the other, in the worker: the window does what a terminal does."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from palpate.case.case_folder import CaseFolder
from palpate.core.files.json_types import plain
from palpate.core.worker.job import Job
from palpate.core.worker.lifeline import give_way
from palpate.core.worker.messages import Message, Reporter
from palpate.core.worker.progress import Progress
from palpate.ui.cli.console import Console
from palpate.ui.cli.main import parser
from palpate.ui.cli.steps import recorded

KIND = "palpate.ui.desktop.session.step_job:run"


class _Telling(Console):
    """A console whose progress goes out as messages. Each has `step`, `step_fraction` and the fraction of all steps."""

    def __init__(self, reporter: Reporter, number: int, count: int, step: str) -> None:
        super().__init__(as_json=False, quiet=True)
        self._reporter, self._number, self._count, self._step = reporter, number, count, step

    @contextmanager
    def progress(self, title: str) -> Iterator[Progress]:
        yield self.tell

    def tell(self, fraction: float, message: str, **details: Any) -> None:
        """One progress message."""
        whole = (self._number + min(max(fraction, 0.0), 1.0)) / self._count
        self._reporter.progress(whole, message, step=self._step, step_fraction=fraction, **details)


def run(job: Job, reporter: Reporter) -> dict[str, Any]:
    """Options: commands, a list of argument lists such as ["mesh", "CASE"]. Returns what each command returned, by its name."""
    give_way()
    commands = [list(command) for command in job.options["commands"]]
    results = {}
    for number, given in enumerate(commands):
        args = parser(given).parse_args(given)
        console = _Telling(reporter, number, len(commands), given[0])
        console.tell(0.0, "starting")
        results[given[0]] = _identify(args, console) if given[0] == "identify" else args._module.run(args, console)[0]
    return results


def _identify(args: argparse.Namespace, console: _Telling) -> dict[str, Any]:
    """As the command does, but particles and objective are told too."""
    from palpate.case.steps import identify  # here, because VTK takes seconds to load
    from palpate.ui.cli.commands.identify import options_of

    def pass_on(message: Message) -> None:
        if message.get("type") == "progress" and "particles" in message:
            details = {key: message[key] for key in ("best", "iteration", "particles")}
            console.tell(identify.overall(message["fraction"]), str(message["message"]), **details)

    case = CaseFolder(args.case)
    options = identify.IdentifyStepOptions(options_of(args), on_message=pass_on)
    with recorded(case, args):
        return plain(identify.run(case, options, console.tell))
