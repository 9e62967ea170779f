"""The one command of this project on every system; `./run` does the same on Linux with less to start.

    python run.py demo              the main job on sample_dicom
    python run.py test [...]        the tests (pytest's arguments)
    python run.py palpate ...       the program
    python run.py setup [--dev]     the environment only; --dev: with what tests and pages need

On Windows `run.cmd` calls it. Needs nothing but Python 3.11 or newer; everything else goes into `.venv`.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

TOP = Path(__file__).resolve().parent
VENV = TOP / ".venv"
PYTHON = VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def main(arguments: list[str]) -> int:
    """Makes the environment where it is not there, then does what is asked; its exit status."""
    command, *rest = arguments or [""]
    if command not in ("demo", "test", "palpate", "setup"):
        print(__doc__, file=sys.stderr)
        return 2
    status = set_up()
    if not status and (command == "test" or (command == "setup" and rest[:1] == ["--dev"])):
        status = _install("requirements.dev.lock", "development.sha256")
    if status or command == "setup":
        return status
    pair = [str(TOP / "sample_dicom" / state) for state in ("rest", "deformed")]
    does = {
        "demo": ["-m", "palpate.ui.cli", "analyze", *pair, "-o", str(TOP / "demo_case")],
        "test": ["-m", "pytest"],
        "palpate": ["-m", "palpate.ui.cli"],
    }
    return _python(*does[command], *rest, cwd=TOP if command == "test" else None)


def set_up() -> int:
    """The packages of the lock by their hashes, then the project, each only where it has changed; 0 or an exit status."""
    if sys.version_info < (3, 11):  # noqa: UP036  # an older one may be what calls it
        print(f"run: Python 3.11 or newer is needed, this is {sys.version.split()[0]}", file=sys.stderr)
        return 3
    if not _noted("packages.sha256", _lock("requirements.lock")) or not PYTHON.exists():
        print(f"run: making the environment in {VENV} (once; a few minutes)", file=sys.stderr)
        shutil.rmtree(VENV, ignore_errors=True)
        made = _status([sys.executable, "-m", "venv", str(VENV)], alone=True)
        made = made or _install("requirements.lock", "packages.sha256")
        if made:
            return made
    if not _noted("project.sha256", _project()):
        made = _pip("--no-deps", "--no-build-isolation", "-e", str(TOP))
        if made == 130:
            return made
        if made:
            print(f"run: the project could not be installed; remove {VENV} and run again", file=sys.stderr)
            return 3
        (VENV / "project.sha256").write_text(_project(), encoding="utf-8")
    return 0


def _install(lock: str, note: str) -> int:
    """The packages of a lock by their hashes, unless the note says that they are there; 0 or an exit status."""
    if _noted(note, _lock(lock)):
        return 0
    made = _pip("--require-hashes", "--only-binary", ":all:", "-r", str(TOP / lock))
    if made == 130:
        return made
    if made:
        print("run: the packages could not be installed; check the network and run again", file=sys.stderr)
        return 3
    (VENV / note).write_text(_lock(lock), encoding="utf-8")
    return 0


def _lock(name: str) -> str:
    return hashlib.sha256((TOP / name).read_bytes()).hexdigest()


def _project() -> str:
    return hashlib.sha256(f"{TOP}\n".encode() + (TOP / "pyproject.toml").read_bytes()).hexdigest()


def _noted(name: str, wanted: str) -> bool:
    """Whether the environment was made from this; `./run` notes the same, with a dash behind."""
    note = VENV / name
    return note.is_file() and note.read_text(encoding="utf-8").split()[:1] == [wanted]


def _pip(*arguments: str) -> int:
    return _python("-m", "pip", "install", "--quiet", "--disable-pip-version-check", *arguments, alone=True)


def _python(*arguments: str, cwd: Path | None = None, alone: bool = False) -> int:
    """The environment's Python; a file in the caller's folder that is called like a library must not stand in for it."""
    seen = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}
    return _status([str(PYTHON), *arguments], {**seen, "PYTHONSAFEPATH": "1"}, cwd, alone)


def _status(command: list[str], env: dict[str, str] | None = None, cwd: Path | None = None, alone: bool = False) -> int:
    """The exit status of a command. alone : Ctrl-C reaches this process only, which ends the command and says so; else the
    command hears it too, says so itself, and is waited for."""
    group = {} if not alone else {"creationflags": 0x200} if os.name == "nt" else {"start_new_session": True}
    process = None
    try:
        process = subprocess.Popen(command, env=env, cwd=cwd, **group)
        return process.wait()
    except KeyboardInterrupt:  # also while the command is being started
        if alone:
            print("run: cancelled; run the same again to go on", file=sys.stderr)
        if process is not None:
            if alone:
                process.terminate()
            process.wait()
        return 130


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit(130)
