"""Job of a worker process: one JSON file."""

from __future__ import annotations

import hashlib
import importlib
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TypeVar

from palpate.core.errors import InputError
from palpate.core.files.atomic import atomic_path
from palpate.core.files.json_types import typed_strictly
from palpate.core.worker.messages import Reporter

FORMAT = 1
T = TypeVar("T")

# Any dotted name would let a job file run whatever Python finds on its path.
_KIND = re.compile(r"palpate(\.[A-Za-z_]\w*)+:[A-Za-z_]\w*")

# Function of a kind of job: takes the job and a reporter, returns JSON data or a declared type (`json_types.plain`).
JobFunction = Callable[["Job", Reporter], object]


@dataclass(frozen=True)
class Job:
    """kind : "palpate.module:function", imported by name, so that a new kind is a new file. folder : for the job's
    files (checkpoint, messages, traceback). paths : input files by role. options : those of the kind. workers : number
    of processes; the result does not depend on it.
    """

    kind: str
    folder: str
    paths: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, object] = field(default_factory=dict)
    seed: int = 0
    workers: int = 1

    def __post_init__(self) -> None:
        if not isinstance(self.kind, str) or not _KIND.fullmatch(self.kind):
            raise InputError(f"job kind {self.kind!r} is not of the form palpate.module:function")
        if not isinstance(self.workers, int) or self.workers < 1:
            raise InputError(f"a job needs at least one worker, not {self.workers!r}")

    def function(self) -> JobFunction:
        """The function of this kind of job. Raises InputError when there is none."""
        module, name = self.kind.split(":")
        try:
            return getattr(importlib.import_module(module), name)
        except (ModuleNotFoundError, AttributeError) as error:
            if isinstance(error, ModuleNotFoundError) and not module.startswith(error.name or " "):
                raise  # a package that the module imports is missing: another defect
            raise InputError(f"no job kind {self.kind!r} in this version of Palpate") from error

    def options_as(self, kind: type[T]) -> T:
        """The options as an instance of the kind's declared type. Raises InputError naming the wrong option."""
        return typed_strictly(dict(self.options), kind, "the job's options", "; start the command again")

    def fingerprint(self) -> str:
        """SHA-256 of everything that the result depends on: kind, options, seed and contents of the files.

        Raises InputError when a file cannot be read.
        """
        content = {name: _sha256(Path(path)) for name, path in self.paths.items()}
        stated = {"kind": self.kind, "options": dict(self.options), "seed": self.seed, "content": content}
        return hashlib.sha256(json.dumps(stated, sort_keys=True).encode()).hexdigest()

    def save(self, path: Path) -> None:
        """Write atomically. Raises InputError when the file cannot be written."""
        with atomic_path(path) as temporary:
            temporary.write_text(json.dumps({"format": FORMAT, **asdict(self)}, indent=1), encoding="utf-8")

    @classmethod
    def load(cls, path: Path) -> Job:
        """A job from its file. Raises InputError when the file is not a job."""
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
            if data.pop("format") != FORMAT:
                raise InputError("made by another version of Palpate")
            return typed_strictly(data, cls, "the job", "")
        except InputError as error:
            raise InputError(f"{path}: {error}; start the command again") from error
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{path}: not a readable job ({type(error).__name__}); start the command again") from error


def _sha256(path: Path) -> str:
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); run the step that makes it again") from error
