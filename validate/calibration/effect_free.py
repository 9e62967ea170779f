"""Effect-free cases of a simulator, each with voxels and contour errors, without the one, the other, or both; and their truth."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.case.case_facts import CaseFacts
from palpate.core.errors import ConvergenceError, InputError
from palpate.core.files.atomic import atomic_path
from palpate.core.statistics import rms
from palpate.imaging.labels import LABELS
from palpate.meshing.mesh_labels import MeshOptions
from palpate.validate.calibration.simulators import SIMULATORS, Drawn
from palpate.validate.simulated.case_files import CasePlan, truth_arrays, write_case
from palpate.validate.simulated.contour_noise import ContourErrors, ContourNoise, errors_of
from palpate.validate.simulated.two_states import TwoStates

# Patients that are looked at for one whose walls can move as was drawn.
_PATIENTS = 8
VOXEL_MM = ((0.8, 1.5), (0.8, 3.0))


@dataclass(frozen=True)
class EffectFree:
    """What is drawn. G_kpa : range of the stiffnesses, even in the logarithm. target_tets : of the case's mesh. sd_mm : range of the
    contours' errors. plain_noise : squared exponential errors alone. stated : whether case.json states their size."""

    seed: int = 1
    G_kpa: tuple[float, float] = (6.0, 100.0)
    target_tets: int = 4000
    sd_mm: tuple[float, float] = (0.2, 0.5)
    plain_noise: bool = False
    stated: bool = True


def solved_states(simulator: str, rng: np.random.Generator, G: tuple[float, float], meshes: Path | None) -> TwoStates:
    """Both states of the first patient whose walls can move as was drawn. Raises ConvergenceError when none of eight can."""
    for _ in range(_PATIENTS):
        try:
            return SIMULATORS[simulator](Drawn(rng, G, meshes))
        except (ConvergenceError, InputError) as error:
            why = error
    raise ConvergenceError(f"none of {_PATIENTS} simulated patients has an equilibrium ({why})")


def make_effect_free(simulator: str, number: int, folder: Path, o: EffectFree) -> Path:
    """Case `number`: FOLDER/NNN/{noisy,clean}_{voxel,exact} are cases, truth.json and truth.npz (see `truth_arrays`) what is true.

    Nothing is done where truth.json is there. Raises ConvergenceError when no patient has an equilibrium.
    """
    path = folder / f"{number:03d}"
    if (path / "truth.json").exists():
        return path
    rng = np.random.default_rng([o.seed, number])
    low, high = np.log(o.G_kpa)
    left, right = np.exp(rng.uniform(low, high, 2)).round(2).tolist()
    states = solved_states(simulator, rng, (left, right), folder / "meshes")
    noise = ContourNoise.drawn(rng, o.sd_mm)
    if o.plain_noise:
        noise = ContourNoise.plain(noise.sd_mm, noise.parts[0].length_mm)
    errors = errors_of(noise, states, rng)
    across, along = rng.uniform(*VOXEL_MM[0]), rng.uniform(*VOXEL_MM[1])
    voxel = (round(across, 2), round(across, 2), round(along, 2))
    stated = round(noise.sd_mm, 3) if o.stated else None
    facts = CaseFacts(f"{simulator} {number:03d}", boundary_noise_sd_mm=stated, other={"simulated": True})
    plan = CasePlan(voxel, facts, MeshOptions(target_tets=o.target_tets))
    for name, drawn in (("noisy", errors), ("clean", ContourErrors.none())):
        write_case(path / f"{name}_voxel", states, drawn, plan, path / f"{name}_exact")
    arrays = truth_arrays(states, errors, voxel)
    with atomic_path(path / "truth.npz") as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
    u = np.linalg.norm(arrays["organ_displacement"], axis=1)
    truth = {
        "name": facts.name,
        "simulator": simulator,
        "seed": [o.seed, number],
        "true_G_kpa": {LABELS[label]: G for label, G in states.G.items()},
        "true_ln_G": [float(np.log(G)) for G in states.G.values()],
        "voxel_mm": voxel,
        "noise": noise.facts(),
        "noise_rms_mm": {key: rms(arrays[key]) for key in arrays if key.endswith("_error")},
        "organ_displacement_rms_mm": rms(u),
        "organ_displacement_max_mm": float(u.max()),
    }
    with atomic_path(path / "truth.json") as temporary:
        temporary.write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")
    return path
