"""Are shifted slices told from bones that moved? ``python tests/benchmarks/slice_steps.py --cases 24 --seed 1``.

Bones of the blind check's pelves alone, no mechanics: in turn all of them moved as one, or the slices above a level were shifted, both by
1 to 8 mm; drawn on voxels, with contour errors. Prints for each what a step between slices explains of what the best rigid motion leaves,
and how far aside it lies, and whether a motion of bone would lose its name (`step_share`, `step_mm`).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.observe.bone_registration import BoneRegistration
from palpate.core.observe.slice_step import SliceStep
from palpate.core.problem import SurfacePair
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.worker.executors import one_thread
from palpate.imaging.labels import BONE
from palpate.meshing.label_surfaces import wall_surface
from palpate.validate.blind.simulator.patients import Patient, Rigid
from palpate.validate.blind.simulator.pelvis import Pelvis
from palpate.validate.simulated.contour_noise import COARSE_MM, STATES, ContourErrors, ContourNoise, Scan

# Ranges of a motion or a shift, mm (and degrees), of voxels in the slice and across, mm, and of the level about the middle, mm.
_SIZE_MM, _ACROSS_MM, _ALONG_MM, _LEVEL_MM = (1.0, 8.0), (0.8, 1.3), (0.8, 3.0), (-6.0, 6.0)
_SOFT_MM, _ROUNDS, _BUILDS = 1.0, 8, 8
_MIDDLE = np.zeros(3)
Displacement = Callable[[FloatArray], FloatArray]


def moved_as_one(size: float, rng: np.random.Generator) -> Displacement:
    """A rigid motion of `size` mm and degrees in random directions: where points (n, 3) mm of the deformed scan have come from, less."""
    shift, turn = rng.standard_normal((2, 3))
    motion = Rigid(size * shift / np.linalg.norm(shift), np.deg2rad(size) * turn / np.linalg.norm(turn), _MIDDLE)
    return motion.displacement


def shifted(size: float, rng: np.random.Generator) -> Displacement:
    """Slices above a level `size` mm aside."""
    angle, level = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(*_LEVEL_MM)
    way = size * np.array([np.cos(angle), np.sin(angle), 0.0])
    return lambda points: way / (1.0 + np.exp(-np.clip((points[:, 2:] - level) / _SOFT_MM, -40.0, 40.0)))


def step_seen(displacement: Displacement, build: int, rng: np.random.Generator) -> SliceStep | None:
    """What a step explains of bones drawn at rest and after; None where they tell no motion."""
    patient = Patient.of(Pelvis.of(build), rng)
    across, along = float(rng.uniform(*_ACROSS_MM)), float(rng.uniform(*_ALONG_MM))
    grid, coarse = patient.grid_of((across, across, along)), patient.grid_of((COARSE_MM,) * 3)

    def from_where(points: FloatArray) -> FloatArray:
        at = points
        for _ in range(_ROUNDS):
            at = points - displacement(at)
        return at

    scans = {
        "rest": Scan(patient.labels),
        "deformed": Scan(lambda points: patient.labels(from_where(points)), from_where),
    }
    errors = ContourErrors.of(ContourNoise.drawn(rng), scans, coarse, rng)
    rest, after = (wall_surface(errors.on(state, scans[state].labels, grid), BONE) for state in STATES)
    noise = NoiseModelOptions()
    floor = np.repeat([noise.bone_floor_mm, noise.bone_floor_deg], 3)
    found = BoneRegistration.of(SurfacePair(rest, after), _MIDDLE, floor, noise.bone_far_mm)
    return None if found is None else found.step


def main() -> None:
    """Prints one line a case, then how many of each kind would lose the name."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=24)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    one_thread()
    rng, rules = np.random.default_rng(args.seed), DecisionRules()
    lost: dict[str, list[bool]] = {"moved as one": [], "shifted": []}
    for number in range(args.cases):
        kind = list(lost)[number % 2]
        size = float(np.exp(rng.uniform(*np.log(_SIZE_MM))))
        displacement = (moved_as_one if kind == "moved as one" else shifted)(size, rng)
        step = step_seen(displacement, int(rng.integers(_BUILDS)), rng)
        if step is None:
            print(f"{number:3d} {kind:12s} {size:4.1f} mm: no motion is told", flush=True)
            continue
        lost[kind].append(step.share > rules.step_share and step.aside_mm > rules.step_mm)
        print(
            f"{number:3d} {kind:12s} {size:4.1f} mm: {step.share:.2f}, {step.aside_mm:.1f} mm, {lost[kind][-1]}",
            flush=True,
        )
    for kind, each in lost.items():
        print(f"{kind}: {sum(each)} of {len(each)} would lose the name of a motion of bone")


if __name__ == "__main__":
    main()
