"""fTetWild, called in a process of its own.

The library writes to standard output from C++ and can only be stopped by ending its process. Run as
``python -m palpate.meshing.tetwild IN.npz OUT.npz``.
"""

from __future__ import annotations

import ctypes
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray, IntArray, NumberArray
from palpate.core.errors import ConvergenceError
from palpate.meshing.tetwild_seed import fix_random_device

# The mesher stops at this energy (its default is 10) and the last bad cells are mended afterwards: a third faster, and
# the finished cells are no worse. From 16 up they are.
STOP_ENERGY = 12.0


@dataclass(frozen=True, eq=False)
class Soup:
    """What fTetWild is given.

    points (n, 3) mm, faces (f, 3): triangles to be followed. size_points (s, 3), size_cells (t, 4), size_mm (s,):
    a background mesh with the wished edge length. edge_mm: the wish beyond it. epsilon_mm: how far the result may
    leave the triangles. seed: of its random numbers.
    """

    points: FloatArray
    faces: IntArray
    size_points: FloatArray
    size_cells: IntArray
    size_mm: FloatArray
    edge_mm: float
    epsilon_mm: float
    seed: int = 0


def tetrahedralize(soup: Soup, timeout_s: float = 600.0) -> tuple[FloatArray, IntArray]:
    """All tetrahedra of the bounding box of a soup: points (n, 3) mm, cells (m, 4) of positive volume.

    Nothing is filtered: what is inside is for the caller to say. On Linux the same soup gives the same mesh. Raises
    ConvergenceError when the mesher dies or takes longer than ``timeout_s``.
    """
    with tempfile.TemporaryDirectory(prefix="palpate-mesh-") as folder:
        given, made = Path(folder, "in.npz"), Path(folder, "out.npz")
        arrays: dict[str, NumberArray] = {name: np.asarray(value) for name, value in vars(soup).items()}
        np.savez(given, **arrays)  # type: ignore[arg-type]
        command = [sys.executable, "-m", "palpate.meshing.tetwild", str(given), str(made)]
        try:
            done = subprocess.run(command, capture_output=True, timeout=timeout_s, check=False)
        except subprocess.TimeoutExpired as late:
            raise ConvergenceError(f"meshing took longer than {timeout_s:g} s; ask for fewer elements") from late
        if done.returncode != 0 or not made.exists():
            last = done.stderr.decode(errors="replace").strip().splitlines()[-1:] or ["no message"]
            raise ConvergenceError(f"the mesher ended with status {done.returncode}: {last[0]}")
        with np.load(made) as result:
            return result["points"], result["cells"]


def _die_with_parent() -> None:
    """On Linux, have this process killed when the one that started it dies: C++ cannot be interrupted from Python."""
    if sys.platform == "linux":
        pr_set_pdeathsig = 1
        ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGKILL)


def _child(given: str, made: str) -> None:
    _die_with_parent()
    import pytetwild
    from pytetwild import PyfTetWildWrapper

    with np.load(given) as soup:
        fix_random_device(Path(PyfTetWildWrapper.__file__), int(soup["seed"]))
        diagonal = float(np.linalg.norm(np.ptp(soup["points"], axis=0)))
        points, cells = pytetwild.tetrahedralize(
            soup["points"],
            soup["faces"].astype(np.int32),
            edge_length_abs=float(soup["edge_mm"]),
            epsilon=float(soup["epsilon_mm"]) / diagonal,
            stop_energy=STOP_ENERGY,
            coarsen=True,
            num_threads=1,
            vtk_ordering=True,
            disable_filtering=True,
            bg_vertices=soup["size_points"],
            bg_tets=soup["size_cells"].astype(np.int32),
            bg_values=soup["size_mm"],
        )
    np.savez(made, points=np.asarray(points, dtype=np.float64), cells=np.asarray(cells, dtype=np.int64))


if __name__ == "__main__":
    _child(sys.argv[1], sys.argv[2])
