"""The mesher's random numbers follow from a seed."""

from __future__ import annotations

import inspect
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pytetwild
import pyvista as pv

from palpate.meshing.tetwild import Soup, tetrahedralize
from palpate.meshing.tetwild_seed import fix_random_device


def soup() -> Soup:
    """A ball in a box with one wished length."""
    ball = pv.Sphere(radius=8.0, theta_resolution=12, phi_resolution=11)
    corners = 12.0 * (np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(-1, 3))
    cells = np.array([[0, 1, 3, 7], [0, 1, 7, 5], [0, 5, 7, 4], [0, 3, 2, 7], [0, 4, 7, 6], [0, 6, 7, 2]])
    faces = ball.faces.reshape(-1, 4)[:, 1:]
    return Soup(np.array(ball.points, dtype=float), faces, corners, cells, np.full(8, 5.0), 5.0, 0.1)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs the tables of Linux' loader")
def test_the_same_seed_gives_the_same_mesh_and_another_seed_another() -> None:
    first, again, other = (tetrahedralize(replace(soup(), seed=s)) for s in (5, 5, 6))
    assert np.array_equal(first[0], again[0])
    assert np.array_equal(first[1], again[1])
    assert first[0].shape != other[0].shape or not np.allclose(first[0], other[0])


@pytest.mark.parametrize("content", [b"", b"\x7fELF\x01\x01" + bytes(80), b"no library at all" * 9])
def test_a_file_that_is_no_library_of_this_kind_is_left_alone(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "library.so"
    path.write_bytes(content)
    assert not fix_random_device(path, 1)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs the tables of Linux' loader")
def test_it_says_whether_a_loaded_library_was_changed() -> None:
    """In a process of its own: the mesher's library is changed, one that draws no such numbers is not, nor one not loaded."""
    program = """
import sys
from pathlib import Path
import numpy.linalg._umath_linalg as other
from palpate.meshing.tetwild_seed import fix_random_device
import importlib.util
mesher = Path(importlib.util.find_spec("pytetwild").origin).parent
(library,) = mesher.glob("PyfTetWildWrapper*.so")
said = [fix_random_device(Path(other.__file__), 1), fix_random_device(library, 1)]
from pytetwild import PyfTetWildWrapper
print([*said, fix_random_device(library, 1)])
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["[False,", "False,", "True]"]


def test_nothing_is_done_on_another_system(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Not even the file is read."""
    monkeypatch.setattr("palpate.meshing.tetwild_seed.sys.platform", "darwin")
    assert not fix_random_device(tmp_path / "not there", 1)


def test_the_mesher_offers_no_seed_of_its_own() -> None:
    """Once it does, pass the seed to it in `tetwild._child` and remove `tetwild_seed`."""
    assert not [name for name in inspect.signature(pytetwild.tetrahedralize).parameters if "seed" in name]
