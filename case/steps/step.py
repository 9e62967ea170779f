"""Declaration of a step: its name, the files it reads and writes, its options' type, and the function that runs it.

Two questions are answered from it. Has the step been done on these inputs? Then it passes over them. Was its result
made from the files that are now in the case? If not, the window marks it "out of date".
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from palpate.case.case_folder import CaseFolder, file_sha256

Hash = Callable[[Path], str]


def _reads_as_declared(case: CaseFolder, reads: tuple[str, ...]) -> tuple[str, ...]:
    return reads


def _no_program() -> str:
    return ""


def _fits(case: CaseFolder) -> str:
    return ""


def _no_record(case: CaseFolder) -> Mapping[str, str] | None:
    return None


@dataclass(frozen=True)
class MadeFrom:
    """Inputs of a run. sha256 : of files, options and program together. files : SHA-256 by name, of the files that
    exist.
    """

    sha256: str
    files: Mapping[str, str]


@dataclass(frozen=True)
class Step:
    """name : of the command. title : description in a few words. reads : files and folders of the case; empty for a
    step that reads from outside the case, as an import does. writes : main result first. options, run :
    "palpate.module:name", imported on demand, because VTK takes seconds. reads_also : in words, files that only some
    cases have. has_job : whether `run` takes `do_job`. inputs_of : `reads` and further inputs of one case. program :
    identifier of the code that shows in the result. record : hashes of inputs in the result itself; they take
    precedence over those of state.json. unlike : why the result does not belong to the case's other results, beyond its files; "" where
    it does.
    """

    name: str
    title: str
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    options: str
    run: str
    reads_also: str = ""
    has_job: bool = False
    inputs_of: Callable[[CaseFolder, tuple[str, ...]], tuple[str, ...]] = _reads_as_declared
    program: Callable[[], str] = _no_program
    record: Callable[[CaseFolder], Mapping[str, str] | None] = _no_record
    unlike: Callable[[CaseFolder], str] = _fits

    @property
    def result(self) -> str:
        """Main result; it exists when the step has run."""
        return self.writes[0]

    def inputs(self, case: CaseFolder) -> tuple[str, ...]:
        """Names of the files and folders that the step reads of this case. Raises InputError for a bad entry of
        case.json.
        """
        return self.inputs_of(case, self.reads)

    def options_type(self) -> type:
        """The type of the step's options."""
        found = _loaded(self.options)
        assert isinstance(found, type)
        return found

    def function(self) -> Callable[..., object]:
        """The function that runs the step."""
        return _loaded(self.run)

    def made_from(self, case: CaseFolder, options: object, hash_of: Hash = file_sha256) -> MadeFrom:
        """Inputs of a run on the case as it is. options : JSON-able form of all options that change the result."""
        known: dict[Path, str] = {}

        def once(path: Path) -> str:
            return known.get(path) or known.setdefault(path, hash_of(path))

        names, program = self.inputs(case), self.program()
        files = {name: case.inputs_sha256([name], hash_of=once) for name in names if case.has(name)}
        return MadeFrom(case.inputs_sha256(names, [options, program] if program else options, once), files)

    def is_done(self, case: CaseFolder, made_from: MadeFrom) -> bool:
        """Whether the step ran to its end on these inputs and its outputs still exist.

        Cases of earlier versions lack the hash of each file; it is noted here.
        """
        done = case.step_is_done(self.name, made_from.sha256)
        if done and self._recorded(case) is None:
            noted = case.step_record(self.name)
            self.mark_done(case, made_from, noted.get("outputs", ()))
        return done

    def mark_done(self, case: CaseFolder, made_from: MadeFrom, outputs: Iterable[str] | None = None) -> None:
        """Note that the step ran to its end. Precondition: all files are written. outputs : `writes` by default."""
        more = {"inputs": dict(made_from.files), "program": self.program()}
        case.mark_done(self.name, made_from.sha256, self.writes if outputs is None else outputs, more)

    def out_of_date(self, case: CaseFolder, hash_of: Hash = file_sha256) -> str | None:
        """Reason why the result was not made from the files that are now in the case; "" where it was, None where that
        is unknown.

        Options do not count but for what `unlike` tells. hash_of : hash of one file. Raises InputError for damaged files.
        """
        recorded = self._recorded(case)
        if recorded is None or not self.reads:
            return None
        for name in sorted({*self.inputs(case), *recorded}):
            now = case.inputs_sha256([name], hash_of=hash_of) if case.has(name) else None
            if now != recorded.get(name):
                return f"{name} has been changed since"
        noted = case.step_record(self.name)
        return self.unlike(case) if noted.get("program", "") == self.program() else "the program has been changed since"

    def _recorded(self, case: CaseFolder) -> Mapping[str, str] | None:
        """Hashes by name of the files that the result was made from; None where unknown."""
        noted = case.step_record(self.name).get("inputs")
        return self.record(case) or (noted if isinstance(noted, Mapping) else None)


def _loaded(name: str) -> Callable[..., object]:
    module, _, attribute = name.partition(":")
    return getattr(importlib.import_module(module), attribute)
