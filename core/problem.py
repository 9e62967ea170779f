"""Numerical problem of a case as plain arrays; the worker process reads it from one file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.files.damaged_archive import DAMAGED_ARCHIVE
from palpate.core.matched_motion import MatchedMotion
from palpate.core.mesh import TetMesh
from palpate.core.surfaces.surface import Surface

FORMAT = 1
_DAMAGED: tuple[type[Exception], ...] = (InputError, *DAMAGED_ARCHIVE)


@dataclass(frozen=True, eq=False)
class SurfacePair:
    """One anatomical surface in both scans, in one frame. common_share : share of the variance of the surfaces' errors
    that both scans have in common, of errors that the surfaces state (`Surface.sd_mm`). carried_to : state ("rest",
    "deformed") to which the surface of the other one was carried over by the images: there it errs as in the other scan and by
    its own sd_mm beside that. Empty where each scan's surface was found by itself."""

    rest: Surface
    deformed: Surface
    common_share: float = 0.0
    carried_to: str = ""

    @property
    def states_errors(self) -> bool:
        """Whether a surface of the two says how far it may be off."""
        return self.rest.sd_mm is not None or self.deformed.sd_mm is not None

    def noise_sd_mm(self, otherwise: float) -> float:
        """Error of one contour as far as the other does not share it by being carried over, rms over both surfaces, mm. otherwise :
        of a surface that states none."""
        both = [np.array([otherwise]) if s.sd_mm is None else s.sd_mm for s in (self.rest, self.deformed)]
        if self.carried_to:
            both[self.carried_to == "rest"] = np.zeros(1)
        return float(np.sqrt(np.mean([(sd**2).mean() for sd in both])))


@dataclass(frozen=True)
class Facts:
    """Scalars of a case.

    tissue_shear_modulus_kpa, tissue_poisson_ratio : of the surrounding tissue. bounds_kpa : of every region's G.
    noise_sd_mm : of one contour, along its normal, where its surface states none. noise_correlation_mm : of contours.
    outer_fixed : whether the outer surface is held. organ_poisson_ratio : fixes the organ's bulk modulus relative to its
    G; not identified. organ_law : name of the organ's strain energy, in `core.laws.LAWS`.
    """

    tissue_shear_modulus_kpa: float = 20.0
    tissue_poisson_ratio: float = 0.49
    bounds_kpa: tuple[float, float] = (5.0, 500.0)
    # What a contour errs by where nobody states it: physicians' prostates differ by 0.7 to 1.7 mm between them and by 1.3 to 1.9 mm of
    # one (Nyholm et al. 2013, on MR, where they are drawn more alike than on CT).
    noise_sd_mm: float = 1.0
    noise_correlation_mm: float = 7.0
    outer_fixed: bool = True
    organ_poisson_ratio: float = 0.495
    organ_law: str = "mooney-rivlin"


@dataclass(frozen=True, eq=False)
class IdentificationProblem:
    """A mesh at rest, the walls that drive it, and the observed surfaces of the organ.

    mesh : regions 3 (tissue) and the organ's. boundary : "bone", "outer", "bladder", "rectum" -> faces (f, 3) of the
    mesh. walls : of the hollow organs, by name. organ : outer surface of the organ, faces marked by region. landmarks :
    (k, 6) mm, rest and deformed position of interior points, or (0, 6). region_names : organ region id -> label name.
    matched : motion that the two images tell, None without images. organ_drawn : whether the organ's deformed surface was drawn, and
    is data; one that follows from the images alone is none, for the motion that they tell counts once.
    """

    mesh: TetMesh
    boundary: Mapping[str, IntArray]
    walls: Mapping[str, SurfacePair]
    organ: SurfacePair
    facts: Facts
    region_names: Mapping[int, str]
    landmarks: FloatArray = field(default_factory=lambda: np.zeros((0, 6)))
    matched: MatchedMotion | None = None
    organ_drawn: bool = True

    @property
    def regions(self) -> tuple[int, ...]:
        """Organ region ids, ascending."""
        return tuple(sorted(self.region_names))

    @property
    def pairs(self) -> tuple[SurfacePair, ...]:
        """Surfaces of the organ and of all walls."""
        return (self.organ, *self.walls.values())

    @property
    def organ_noise_mm(self) -> float:
        """Error of one contour of the organ, rms over its surface, mm."""
        return self.organ.noise_sd_mm(self.facts.noise_sd_mm)

    @property
    def states_errors(self) -> bool:
        """Whether a surface says how far it may be off."""
        return any(pair.states_errors for pair in self.pairs)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """For numpy.savez; `from_arrays` is the inverse."""
        out: dict[str, NDArray[np.generic]] = {
            "points": self.mesh.points,
            "cells": self.mesh.cells,
            "cell_regions": self.mesh.regions,
            "landmarks": self.landmarks,
        }
        for name, faces in self.boundary.items():
            out[f"boundary/{name}"] = faces
        for name, pair in {**{f"walls/{k}": v for k, v in self.walls.items()}, "organ": self.organ}.items():
            out |= _of_pair(name, pair)
        if self.matched is not None:
            out |= {f"matched/{key}": values for key, values in self.matched.arrays().items()}
        scalars = {"format": FORMAT, "facts": self.facts.__dict__, "region_names": dict(self.region_names)}
        if not self.organ_drawn:
            scalars["organ_drawn"] = False
        out["scalars"] = np.frombuffer(json.dumps(scalars).encode(), dtype=np.uint8)
        return out

    @classmethod
    def from_arrays(cls, data: Mapping[str, NDArray[np.generic]]) -> IdentificationProblem:
        """Raises InputError when the arrays come from another version."""
        scalars = json.loads(bytes(np.asarray(data["scalars"], dtype=np.uint8)).decode())
        if scalars["format"] != FORMAT:
            raise InputError(f"identification problem has format {scalars['format']}, not {FORMAT}; identify again")
        facts = Facts(**{**scalars["facts"], "bounds_kpa": tuple(scalars["facts"]["bounds_kpa"])})
        walls = sorted({k.split("/")[1] for k in data if k.startswith("walls/")})
        return cls(
            mesh=TetMesh(*(np.asarray(data[k]) for k in ("points", "cells", "cell_regions"))),
            boundary={k.split("/")[1]: np.asarray(data[k]) for k in data if k.startswith("boundary/")},
            walls={name: _pair(data, f"walls/{name}") for name in walls},
            organ=_pair(data, "organ"),
            facts=facts,
            region_names={int(k): v for k, v in scalars["region_names"].items()},
            landmarks=np.asarray(data["landmarks"], dtype=float),
            matched=_matched(data),
            organ_drawn=bool(scalars.get("organ_drawn", True)),
        )

    @classmethod
    def load(cls, path: Path) -> IdentificationProblem:
        """Raises InputError when the file is missing or not such a problem."""
        try:
            with np.load(path, allow_pickle=False) as data:
                return cls.from_arrays({k: data[k] for k in data.files})
        except _DAMAGED as error:
            raise InputError(f"{path}: not a readable identification problem ({error}); run identify again") from error


def _matched(data: Mapping[str, NDArray[np.generic]]) -> MatchedMotion | None:
    found = {key.removeprefix("matched/"): values for key, values in data.items() if key.startswith("matched/")}
    return MatchedMotion.from_arrays(found) if found else None


def _of_pair(name: str, pair: SurfacePair) -> dict[str, NDArray[np.generic]]:
    out: dict[str, NDArray[np.generic]] = {}
    for state, surface in (("rest", pair.rest), ("deformed", pair.deformed)):
        for key in ("points", "faces", "region"):
            out[f"{name}/{state}/{key}"] = getattr(surface, key)
        for key in ("sd_mm", "voxel_errors"):
            if getattr(surface, key) is not None:
                out[f"{name}/{state}/{key}"] = getattr(surface, key)
    if pair.states_errors:
        out[f"{name}/common_share"] = np.array(pair.common_share)
    if pair.carried_to:
        out[f"{name}/carried_to_rest"] = np.array(pair.carried_to == "rest")
    return out


def _pair(data: Mapping[str, NDArray[np.generic]], name: str) -> SurfacePair:
    rest, deformed = (_surface(data, f"{name}/{state}") for state in ("rest", "deformed"))
    share, to_rest = data.get(f"{name}/common_share", 0.0), data.get(f"{name}/carried_to_rest")
    carried = "" if to_rest is None else "rest" if bool(to_rest) else "deformed"
    return SurfacePair(rest, deformed, float(np.asarray(share)), carried)


def _surface(data: Mapping[str, NDArray[np.generic]], name: str) -> Surface:
    points, faces, region = (np.asarray(data[f"{name}/{key}"]) for key in ("points", "faces", "region"))
    sd, voxels = (data.get(f"{name}/{key}") for key in ("sd_mm", "voxel_errors"))
    return Surface(
        points,
        faces,
        region,
        None if sd is None else np.asarray(sd, dtype=float),
        None if voxels is None else np.asarray(voxels, dtype=float),
    )


# The problem of one deformed state, and the bones' surfaces at rest and in that state, None where they were not
# segmented.
StateData = tuple[IdentificationProblem, SurfacePair | None]
