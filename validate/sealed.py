"""A study whose answers are sealed by hash before anything is analysed, and opened after all is written.

Every case is analysed in a process of its own that is given the case's path alone. A ledger holds the SHA-256 of every answer,
written before the first analysis, and of every result, written before the first answer is opened again.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import TypeVar

from palpate.case.case_folder import file_sha256
from palpate.core.errors import Cancelled, InputError
from palpate.core.files.atomic import atomic_path
from palpate.core.worker.progress import Progress

# What all cases of one study have in common, by name.
Kind = Mapping[str, object]
# Analyses one case, whose path it is given, and writes the result there.
Analyse = Callable[[Path], None]


@dataclass(frozen=True)
class SealedStudy:
    """FOLDER/cases, FOLDER/answers and FOLDER/ledger.json. result : name of the file in a case that its analysis writes.

    The ledger holds the kind of the study and, once sealed, `answers` and `diagnoses`: SHA-256 by case (None: there is no result).
    """

    folder: Path
    result: str

    @property
    def cases(self) -> Path:
        """Folder of the cases."""
        return self.folder / "cases"

    @property
    def answers(self) -> Path:
        """Folder of what is true of them."""
        return self.folder / "answers"

    @property
    def ledger_path(self) -> Path:
        """The ledger."""
        return self.folder / "ledger.json"

    def begin(self, asked: Kind, unless_said: Kind, flags: Callable[[Kind], str]) -> None:
        """Start the ledger with the kind of study it is of.

        unless_said : what a ledger that does not say so is of. flags : a kind as options of the command. Raises InputError where the
        folder's study is of another kind.
        """
        self.cases.mkdir(parents=True, exist_ok=True)
        ledger = self._ledger() if self.ledger_path.exists() else {}
        # from before there were other kinds, or ledgers that began before the answers
        is_old = bool(ledger) or any(self.answers.glob("*.json"))
        held = {name: ledger.get(name, unless_said[name]) for name in asked} if is_old else dict(asked)
        if held != dict(asked):
            raise InputError(
                f"the study in {self.folder} was made with {flags(held)}; give that, or an empty folder for one with {flags(asked)}"
            )
        if not ledger:
            self._write(dict(asked))

    def made(self, names: Sequence[str]) -> list[str]:
        """Those of the cases that have an answer."""
        return [name for name in names if (self.answers / f"{name}.json").exists()]

    def seal(self, names: Sequence[str]) -> None:
        """Write the answers' hashes, once. Raises InputError when the ledger seals other answers."""
        hashes = {name: file_sha256(self.answers / f"{name}.json") for name in names}
        ledger = self._ledger()
        if "answers" not in ledger:
            self._write(ledger | {"answers": hashes, "diagnoses": {}})
        elif ledger["answers"] != hashes:
            raise InputError(
                f"{self.ledger_path} seals other answers than those beside it; give an empty folder for a new study"
            )

    def analyse(self, names: Sequence[str], analyse: Analyse, workers: int, progress: Progress) -> None:
        """Every case that has no result yet; the ledger gets each one's hash as it is written."""
        todo = [name for name in names if not (self.cases / name / self.result).exists()]
        with ThreadPoolExecutor(workers) as pool:
            began = monotonic()
            running = {pool.submit(analyse, self.cases / name): name for name in todo}
            for k, done in enumerate(as_completed(running), 1):
                done.result()
                self._note(running[done])
                left = time_left(monotonic() - began, k, len(running))
                progress(k / len(running), f"analysed {k} of {len(running)}{left}")
        for name in names:
            self._note(name)

    def check_unchanged(self) -> None:
        """Raises InputError when an answer is not the one that was sealed."""
        sealed = self._ledger()["answers"]
        assert isinstance(sealed, dict)
        for name, sha in sealed.items():
            if file_sha256(self.answers / f"{name}.json") != sha:
                raise InputError(
                    f"{self.answers / name}.json was changed after it was sealed; the study is worth nothing, start it anew"
                )

    def _note(self, name: str) -> None:
        result, ledger = self.cases / name / self.result, self._ledger()
        results = ledger["diagnoses"]
        assert isinstance(results, dict)
        results[name] = file_sha256(result) if result.exists() else None
        self._write(ledger)

    def _ledger(self) -> dict[str, object]:
        found: dict[str, object] = json.loads(self.ledger_path.read_text(encoding="utf-8"))
        return found

    def _write(self, data: Mapping[str, object]) -> None:
        with atomic_path(self.ledger_path) as temporary:
            temporary.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def run_program(words: Sequence[str], case: Path, log_name: str, timeout_s: float) -> None:
    """A command of the program; see `run_alone`."""
    run_alone([sys.executable, "-m", "palpate.ui.cli", *words], case, log_name, timeout_s)


def run_alone(command: Sequence[str], case: Path, log_name: str, timeout_s: float) -> None:
    """Run a command in a case's folder, in a process of its own; what it says goes to log_name in the case.

    Raises Cancelled where somebody stopped the command: that is no answer, and the study stops too.
    """
    with (case / log_name).open("a", encoding="utf-8") as log:
        try:
            ended = subprocess.run(command, cwd=case, stdout=log, stderr=log, timeout=timeout_s, check=False)
        except subprocess.TimeoutExpired:
            log.write("timed out\n")
            return
    if ended.returncode == Cancelled.exit_code:
        raise Cancelled("a command of the study was stopped; run the study again to go on")


Item = TypeVar("Item")


def make_each(make: Callable[[Item], object], items: Sequence[Item], workers: int, progress: Progress) -> None:
    """make(item) for all items. With more than one worker `make` and the items must be picklable. Raises what `make` raises."""
    count = len(items)
    began = monotonic()

    def told(k: int) -> None:
        progress(k / count, f"made {k} of {count}{time_left(monotonic() - began, k, count)}")

    if workers < 2:
        for k, item in enumerate(items, 1):
            make(item)
            told(k)
        return
    with ProcessPoolExecutor(workers) as pool:
        running = [pool.submit(make, item) for item in items]
        for k, done in enumerate(as_completed(running), 1):
            done.result()
            told(k)


def time_left(seconds: float, done: int, count: int) -> str:
    """`, about 12 min left` after so many seconds for what is done; nothing where all is."""
    minutes = seconds / done * (count - done) / 60.0
    return f", about {math.ceil(minutes)} min left" if done < count else ""
