"""Meshes on disk: one npz with the mesh, its named boundary and its quality; and the hash it is kept under."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from palpate.core.arrays import IntArray, NumberArray
from palpate.core.errors import InputError
from palpate.core.files.atomic import atomic_path
from palpate.core.files.damaged_archive import DAMAGED_ARCHIVE
from palpate.core.mesh import TetMesh
from palpate.imaging.volume import Volume
from palpate.meshing.quality import MeshQuality

# Raised when the way of meshing changes, so that meshes kept from before are not taken for new ones.
RECIPE_VERSION = 3
# A file may be whole and hold no mesh.
_DAMAGED: tuple[type[Exception], ...] = (InputError, *DAMAGED_ARCHIVE)


@dataclass(frozen=True, eq=False)
class Recipe:
    """What a mesh is made from: the labels, and the options by name."""

    labels: Volume
    options: Mapping[str, object]


def recipe_hash(recipe: Recipe) -> str:
    """The sha256, in hex, of labels, placement, options and the mesher's version."""
    facts = {
        "recipe": RECIPE_VERSION,
        "pytetwild": version("pytetwild"),
        "options": recipe.options,
        "shape": list(recipe.labels.array.shape),
        "affine": np.round(recipe.labels.affine, 9).tolist(),
    }
    digest = hashlib.sha256(json.dumps(facts, sort_keys=True).encode())
    digest.update(np.ascontiguousarray(recipe.labels.array, dtype=np.uint8).tobytes())
    return digest.hexdigest()


def mesh_arrays(mesh: TetMesh, boundary: dict[str, IntArray]) -> dict[str, NumberArray]:
    """The arrays of a mesh by name: points, cells, regions, boundary_NAME."""
    named: dict[str, NumberArray] = {f"boundary_{name}": faces for name, faces in boundary.items()}
    return {"points": mesh.points, "cells": mesh.cells, "regions": mesh.regions} | named


def save_mesh(path: Path, mesh: TetMesh, boundary: dict[str, IntArray], quality: MeshQuality) -> None:
    """Write a mesh; the file appears whole or not at all. Raises InputError when it cannot be written."""
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        told = np.array(json.dumps(quality))
        np.savez_compressed(stream, quality=told, **mesh_arrays(mesh, boundary))  # type: ignore[arg-type]


def load_mesh(path: Path) -> tuple[TetMesh, dict[str, IntArray], MeshQuality]:
    """The mesh, its named boundary faces and its quality from a file of ``save_mesh``.

    Raises InputError naming the file when it is missing, damaged or holds no mesh.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            mesh = TetMesh(file["points"], file["cells"], file["regions"])
            prefix = "boundary_"
            boundary = {name[len(prefix) :]: file[name] for name in file.files if name.startswith(prefix)}
            quality: MeshQuality = json.loads(str(file["quality"])) if "quality" in file.files else {}
    except FileNotFoundError as error:
        raise InputError(f"{path} is not there; run the step that writes it first") from error
    except _DAMAGED as error:
        raise InputError(f"{path} is damaged; remove it and run the step that writes it again") from error
    return mesh, boundary, quality
