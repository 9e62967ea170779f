"""The palpate program in an environment of its own, made from the module after asking: Slicer's own Python stays as it is."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from .errors import InputError
from .pipeline import Pipeline, Step
from .program import environment

QUESTION = (
    "The palpate program was not found. Install it into an environment of its own?\n\n"
    "Some minutes and 3.2 GB, from {source} into {target}. Slicer's own Python is not changed."
)
_NEEDED = (3, 11)
_WINDOWS = os.name == "nt"


def target_folder() -> Path:
    """Where the environment goes: in the person's home, whatever Slicer is installed."""
    return Path.home() / ".palpate" / "environment"


def program_in(target: Path) -> Path:
    """The program of an environment."""
    return target / ("Scripts/palpate.exe" if _WINDOWS else "bin/palpate")


def source_folder() -> Path:
    """The repository that this module lies in. Raises InputError where it lies elsewhere."""
    folder = Path(__file__).resolve().parents[3]
    if not ((folder / "pyproject.toml").is_file() and (folder / "requirements.lock").is_file()):
        raise InputError(
            "The module does not lie in the repository of Palpate, so there is nothing to install from. Clone the repository and "
            "add plugin/PalpateStiffness of the clone as a module path, or give the program under Advanced."
        )
    return folder


def find_python() -> str:
    """A Python of this machine, not Slicer's, that can make environments. Raises InputError saying what to install."""
    seen = environment()
    for name in ("python3.13", "python3.12", "python3.11", "python3", "python", "py"):
        found = shutil.which(name, path=seen.get("PATH"))
        if found is not None and _can(found, seen):
            return found
    raise InputError(
        "No Python 3.11 or newer with venv and pip was found; install one from python.org and press the button again."
    )


def install_pipeline(python: str, source: Path, target: Path) -> Pipeline:
    """Environment, packages by their hashes, then the program. Each step shows what it prints in the log."""
    pip = [
        str(target / ("Scripts/python.exe" if _WINDOWS else "bin/python")),
        "-m",
        "pip",
        "install",
        "--disable-pip-version-check",
    ]
    packages = [*pip, "--require-hashes", "--only-binary", ":all:", "-r", str(source / "requirements.lock")]
    return Pipeline([
        Step("environment", [python, "-m", "venv", "--clear", str(target)], 0.05, json=False),
        Step("packages", packages, 1.0, json=False),
        Step("program", [*pip, "--no-deps", str(source)], 0.1, json=False),
    ])  # fmt: skip


def _can(python: str, seen: dict[str, str]) -> bool:
    code = f"import sys, venv, ensurepip; sys.exit(sys.version_info < {_NEEDED})"
    try:
        return (
            subprocess.run([python, "-c", code], env=seen, capture_output=True, check=False, timeout=30).returncode == 0
        )
    except (OSError, subprocess.TimeoutExpired):
        return False
