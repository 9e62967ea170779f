"""One declaration a step: its name, what it reads and writes of a case, its options, and the function that runs it.

Every question about a step is answered from its declaration: whether it has been done on these inputs (the step passes over), and whether
what it left in the case was made from what now lies there (the window's "out of date").
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


def _no_record(case: CaseFolder) -> Mapping[str, str] | None:
    return None


@dataclass(frozen=True)
class MadeFrom:
    """Inputs of a run. sha256 : of files, options and program together. files : SHA-256 by name, of those that are there."""

    sha256: str
    files: Mapping[str, str]


@dataclass(frozen=True)
class Step:
    """name : of the command. title : what it does, in a few words. reads : files and folders of the case; empty for a step that reads
    from outside it, as an import does. writes : its main result first. options, run : "palpate.module:name", loaded when asked for,
    because VTK takes seconds. reads_also : what only some cases have, in words. has_job : `run` takes `do_job`, which does its sums.
    inputs_of : `reads` and what is read of one case beside. program : identifies what of the program shows in the result. record :
    hashes of inputs that the result itself holds; they take precedence over those of state.json.
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

    @property
    def result(self) -> str:
        """The file that is there when the step has run."""
        return self.writes[0]

    def inputs(self, case: CaseFolder) -> tuple[str, ...]:
        """Names of the files and folders that the step reads of this case. Raises InputError for a bad entry of case.json."""
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
        """What the step would run on now. options : JSON-able form of all options that change the result."""
        known: dict[Path, str] = {}

        def once(path: Path) -> str:
            return known.get(path) or known.setdefault(path, hash_of(path))

        names, program = self.inputs(case), self.program()
        files = {name: case.inputs_sha256([name], hash_of=once) for name in names if case.has(name)}
        return MadeFrom(case.inputs_sha256(names, [options, program] if program else options, once), files)

    def is_done(self, case: CaseFolder, made_from: MadeFrom) -> bool:
        """Whether the step ran to its end on exactly this and its outputs are still there.

        Cases of earlier versions did not note the hash of each file; this is made good here.
        """
        done = case.step_is_done(self.name, made_from.sha256)
        if done and self._recorded(case) is None:
            noted = case.step_record(self.name)
            self.mark_done(case, made_from, noted.get("outputs", ()))
        return done

    def mark_done(self, case: CaseFolder, made_from: MadeFrom, outputs: Iterable[str] | None = None) -> None:
        """Notes that the step ran to its end; call it after the last file is written. outputs : `writes` by default."""
        more = {"inputs": dict(made_from.files), "program": self.program()}
        case.mark_done(self.name, made_from.sha256, self.writes if outputs is None else outputs, more)

    def out_of_date(self, case: CaseFolder, hash_of: Hash = file_sha256) -> str | None:
        """Why the step's result was not made from what lies in the case now; "" where it was; None where the case does not say.

        Options do not count: a result made with other options is a result. hash_of : the hash of one file. Raises InputError for
        damaged files.
        """
        recorded = self._recorded(case)
        if recorded is None or not self.reads:
            return None
        for name in sorted({*self.inputs(case), *recorded}):
            now = case.inputs_sha256([name], hash_of=hash_of) if case.has(name) else None
            if now != recorded.get(name):
                return f"{name} has been changed since"
        noted = case.step_record(self.name)
        return "" if noted.get("program", "") == self.program() else "the program has been changed since"

    def _recorded(self, case: CaseFolder) -> Mapping[str, str] | None:
        """Hash by name of the files that the result was made from."""
        noted = case.step_record(self.name).get("inputs")
        return self.record(case) or (noted if isinstance(noted, Mapping) else None)


def _loaded(name: str) -> Callable[..., object]:
    module, _, attribute = name.partition(":")
    return getattr(importlib.import_module(module), attribute)
