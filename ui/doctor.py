"""What works on this machine."""

from __future__ import annotations

import os
import platform
import re
import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from palpate.core.errors import InputError
from palpate.core.worker.executors import cores
from palpate.core.worker.progress import Progress, silent
from palpate.ui import system_libraries

MIN_PYTHON = (3, 11)
MIN_MEMORY_GIB = 4.0
MIN_DISK_GIB = 1.0


@dataclass(frozen=True)
class Check:
    """One thing looked at. needed : whether Palpate cannot work without it. remedy : what to do when it does not work."""

    name: str
    works: bool
    found: str
    needed: bool = True
    remedy: str = ""

    def to_dict(self) -> dict[str, str | bool]:
        """For JSON."""
        return asdict(self)


def examine(progress: Progress = silent) -> list[Check]:
    """All checks; none raises."""
    looks: tuple[Callable[[], Check], ...] = (
        _python, _packages, _solver, _rendering, _libraries, _window, _disk, _cores, _memory,
    )  # fmt: skip
    checks = []
    for done, look in enumerate(looks):
        progress(done / len(looks), look.__name__.strip("_"))
        checks.append(look())
    progress(1.0, "done")
    return checks


def missing_packages() -> tuple[dict[str, str], list[str]]:
    """Versions of the packages that Palpate's metadata asks for, and those that are absent."""
    versions, absent = {}, []
    for line in metadata.requires("palpate") or []:
        requirement, _, marker = line.partition(";")
        if "extra" in marker or ("x86_64" in marker and platform.machine() != "x86_64"):
            continue
        name = re.split(r"[^A-Za-z0-9._-]", requirement.strip(), maxsplit=1)[0]
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            absent.append(name)
    return versions, absent


def _python() -> Check:
    found = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    wanted = ".".join(map(str, MIN_PYTHON))
    return Check("python", sys.version_info >= MIN_PYTHON, found, True, f"install Python {wanted} or newer")


def _packages() -> Check:
    versions, absent = missing_packages()
    found = ", ".join(f"{name} {version}" for name, version in versions.items())
    if absent:
        return Check("packages", False, f"absent: {', '.join(absent)}", True, "remove .venv and run ./run again")
    return Check("packages", True, found)


def _solver() -> Check:
    """Solves one indefinite system with PARDISO; SuperLU serves where it is absent, at a fraction of the speed."""
    try:
        from pypardiso import PyPardisoSolver

        A = sp.csr_matrix(np.array([[4.0, 1.0, 1.0], [1.0, 3.0, 0.0], [1.0, 0.0, -2.0]]))
        x = PyPardisoSolver().solve(A, np.array([6.0, 4.0, -1.0]))
    except (ImportError, OSError) as error:
        why = str(error).splitlines()[0]
        return Check(
            "PARDISO", False, f"{why}; SuperLU is used, which is several times slower", False, "pip install pypardiso"
        )
    works = bool(np.allclose(x, 1.0))
    return Check(
        "PARDISO", works, "solves" if works else f"wrong solution {x}", True, "pip install --force-reinstall mkl"
    )


def _rendering() -> Check:
    # Here, so that the other checks work where VTK does not load.
    from palpate.ui.pictures import offscreen

    try:
        offscreen.check()
    except offscreen.OffscreenError as error:
        return Check("off-screen rendering", False, f"{error}; reports lack the 3D views", False, offscreen.REMEDY)
    return Check("off-screen rendering", True, "draws", False)


def _libraries() -> Check:
    """Those of the system that the window needs, told also where there is no display."""
    absent = system_libraries.missing()
    if not absent:
        return Check("window's libraries", True, "all there", False)
    why = f"absent: {', '.join(absent)}; `palpate open` and `palpate touch` need them, nothing else does"
    return Check("window's libraries", False, why, False, system_libraries.remedy(absent))


def _window() -> Check:
    # Here, so that the other checks work where Qt does not load.
    from palpate.ui.desktop.window import display_server

    try:
        display_server.check(headless=False)
    except InputError as error:
        why, _, remedy = str(error).partition("; ")
        return Check(
            "window", False, f"{why}; `palpate open` and `palpate touch` need one, nothing else does", False, remedy
        )
    return Check("window", True, "opens", False)


def _disk() -> Check:
    folder = tempfile.gettempdir()
    try:
        with tempfile.NamedTemporaryFile(prefix="palpate-doctor-") as file:
            file.write(b"0" * 4096)
            file.flush()
    except OSError as error:
        return Check("temporary folder", False, f"{folder}: {error.strerror}", True, "set TMPDIR to a writable folder")
    free = shutil.disk_usage(folder).free / 2**30
    return Check(
        "temporary folder", free > MIN_DISK_GIB, f"{folder}, {free:.1f} GiB free", True, "free some disk space"
    )


def _cores() -> Check:
    return Check("cores", True, f"{cores()}")


def _memory() -> Check:
    total = memory_gib()
    if total is None:
        return Check("memory", True, "size not known", False)
    return Check("memory", total >= MIN_MEMORY_GIB, f"{total:.1f} GiB", False, f"{MIN_MEMORY_GIB:.0f} GiB are advised")


def memory_gib() -> float | None:
    """Memory that this process may use, GiB: the machine's, or the container's limit where that is less."""
    if not hasattr(os, "sysconf") or "SC_PHYS_PAGES" not in os.sysconf_names:
        return None
    total = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    limit = Path("/sys/fs/cgroup/memory.max")
    text = limit.read_text().strip() if limit.is_file() else "max"
    return min(total, float(text)) / 2**30 if text.isdigit() else total / 2**30
