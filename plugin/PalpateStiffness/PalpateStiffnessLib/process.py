"""One call of the palpate program in a child process: progress while it runs, its JSON when it ended, a cancel that kills all of it."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from .program import environment

# From asking to killing: leaves room below the second in which a cancel must be done.
GRACE_S = 0.4
_PROGRESS = re.compile(r"^(\w+) +(\d+) %: (.*)$")
_POSIX = os.name == "posix"


class ProgramCall:
    """command : the whole command line but `--json`, which is added where as_json. log : the lines it printed, without the result.

    fraction (0 to 1) and message : how far it is, from its standard error. Reading happens in threads: nothing here blocks
    but ``wait``.
    """

    def __init__(self, command: Sequence[str], as_json: bool = True) -> None:
        self.fraction, self.message = 0.0, "starting"
        self._output, self._errors = "", ""
        self.log: list[str] = []
        self._as_json = as_json
        group = {"start_new_session": True} if _POSIX else {"creationflags": 0x00000200}  # CREATE_NEW_PROCESS_GROUP
        whole = [*command, "--json"] if as_json else [*command]
        self.process = subprocess.Popen(
            whole, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            encoding="utf-8", errors="replace", env=environment(), **group,  # type: ignore[call-overload]
        )  # fmt: skip
        self._readers = [threading.Thread(target=read, daemon=True) for read in (self._read_output, self._read_errors)]
        for reader in self._readers:
            reader.start()

    @property
    def is_running(self) -> bool:
        """Whether the process or what it printed is not at its end."""
        return self.process.poll() is None or any(reader.is_alive() for reader in self._readers)

    @property
    def exit_code(self) -> int | None:
        """0 done, 2 wrong usage, 3 bad input, 4 no convergence, 130 cancelled; None while it runs."""
        return None if self.is_running else self.process.returncode

    def wait(self, timeout_s: float = 600.0) -> int:
        """Waits for the end and returns the exit code. Raises TimeoutError."""
        end = time.monotonic() + timeout_s
        while self.is_running:
            if time.monotonic() > end:
                raise TimeoutError(f"not done after {timeout_s:.0f} s: {self.message}")
            time.sleep(0.02)
        return int(self.process.returncode)

    def result(self) -> dict[str, Any]:
        """The JSON object that the program printed; empty where it printed none."""
        lines = self._output.strip().splitlines()
        try:
            found = json.loads(lines[-1]) if lines else {}
        except ValueError:
            found = {}
        return found if isinstance(found, dict) else {}

    def error(self) -> str:
        """In one line why it failed; empty where it did not."""
        if not self.exit_code:
            return ""
        lines = self._errors.strip().splitlines()
        return str(self.result().get("error") or (lines[-1] if lines else f"ended with status {self.exit_code}"))

    def cancel(self) -> None:
        """Asks the program to stop, and kills it and every process that it started when it does not within GRACE_S."""
        if self.process.poll() is not None:
            return
        started = descendants(self.process.pid)
        if _POSIX:
            self.process.terminate()
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(GRACE_S)
        kill_tree(self.process.pid, started)
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(GRACE_S)

    def _read_output(self) -> None:
        assert self.process.stdout is not None
        if self._as_json:
            self._output = self.process.stdout.read()
        else:
            for line in self.process.stdout:
                self._hear(line)
        self.process.stdout.close()

    def _hear(self, line: str) -> None:
        """A line for the log; of progress only what is new."""
        said = line.strip()
        if said and (not self.log or self.log[-1] != said):
            self.log.append(said)
            if not self._as_json:
                self.message = said[:120]

    def _read_errors(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self._hear(line)
            match = _PROGRESS.match(line.strip())
            if match is None:
                self._errors += line
            else:
                self.fraction, self.message = int(match[2]) / 100.0, f"{match[1]}: {match[3]}"
        self.process.stderr.close()


def kill_tree(process: int, known: Sequence[int] = ()) -> None:
    """Kills a process, its group, and every process that came from it."""
    if not _POSIX:
        subprocess.run(["taskkill", "/F", "/T", "/PID", str(process)], capture_output=True, check=False)
        return
    family = {*known, *descendants(process)}
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process, signal.SIGKILL)
    for member in family:
        with suppress(ProcessLookupError, PermissionError):
            os.kill(member, signal.SIGKILL)


def descendants(process: int) -> list[int]:
    """Children of a process, their children, and so on; empty on Windows, where taskkill finds them itself."""
    parents = _parents() if _POSIX else {}
    found: list[int] = []
    new = [process]
    while new:
        new = [child for child, parent in parents.items() if parent in new]
        found += new
    return found


def _parents() -> dict[int, int]:
    if sys.platform != "linux":
        listed = subprocess.run(["ps", "-A", "-o", "pid=,ppid="], capture_output=True, text=True, check=False).stdout
        return {int(a): int(b) for a, b in (line.split() for line in listed.splitlines())}
    parents = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            with suppress(OSError):  # it has ended meanwhile
                # The name in brackets may hold anything; what follows the last bracket is state and parent.
                parents[int(folder.name)] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
    return parents
