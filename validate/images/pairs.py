"""Pairs of scans for a study of images: a real CT, its second state simulated, everything that is not the anatomy drawn at random."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from palpate.case.steps.simulate.step import run_simulate
from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.files.atomic import atomic_path
from palpate.validate.images.records import ImagesOptions, Specification

# Limits between which each is drawn, evenly (stiffness in the logarithm): kPa; growth of the rectum's radius and its shift towards the
# back, mm (it empties: filled, it would crush the thin tissue before it); half the length that moves; how the patient lies.
STIFFNESS_KPA, INFLATE_MM, PUSH_MM, HALF_LENGTH_MM = (15.0, 100.0), (-4.5, -3.0), (3.0, 5.0), (55.0, 65.0)
SHIFT_MM, TURN_DEG, ASIDE_MM = 3.0, 0.7, 1.0
# Standard deviation of the contours' error along the normal, mm, which is what the program takes where nobody states one; and over which
# distances on the surface it changes.
CONTOUR_SD_MM, CORRELATION_MM = 0.4, (6.0, 12.0)
# Edge of the simulation's cells on the organ, mm, and their element, which is not the program's. Images see a tenth of a millimetre:
# cells of 6.5 mm of `p2` were off by 0.14 to 0.18 mm, which says a stiffness a tenth too low.
EDGE_MM, ELEMENT = 4.8, "p2p0"
# What may be hidden, each between limits: the factor of moduli (drawn evenly in the logarithm, a soft one in two of five), a
# focus's radius, mm, and how far from its half's centroid it lies along each axis, how far from the organ's centroid tissue changes,
# how thick the layer is in which the organ slides, mm, and how much softer: of half that thickness its cells fold over themselves.
FACTOR, RADIUS_MM, OFFSET_MM, FROM_MM, LAYER_MM, SOFTER = (3.0, 10.0), (7.0, 10.0), 5.0, (-3.0, 6.0), 6.0, (4.0, 20.0)
# How thick an organ's rind is, mm: a cell's edge and more.
RIND_MM = (5.0, 8.0)
SOFT_SHARE = 0.4
# What else may differ in the second scan, in every second pair of each scan: each with this probability.
CHANGES, CHANGE_SHARE = ("contrast", "kernel", "noise", "streaks"), 0.5
# Number of the way in which pairs are made; another one makes another study.
MAKING = 5
# Another wall motion is drawn where the tissue folds, so many times.
ATTEMPTS = 3


def name_of(number: int) -> str:
    """Name of a pair."""
    return f"pair_{number:04d}"


def make_pair(options: ImagesOptions, number: int, folder: Path) -> bool:
    """FOLDER/cases/NAME/scans and FOLDER/answers/NAME.json; whether the pair could be made. Where it could not, FOLDER/unmade/NAME.txt
    says why, a line for each wall motion that was tried. Nothing is done where either is there.

    Stiffness and hidden effect are drawn once: whether a wall's motion has an equilibrium must not select them. All pairs of a CT
    share the simulation's mesh, FOLDER/meshes. Raises InputError for scans or contours that cannot be read.
    """
    name, answers = name_of(number), folder / "answers"
    if (answers / f"{name}.json").exists():
        return True
    if unmade(folder, name):
        return False
    ct, labels = options.scans[number % len(options.scans)]
    rng = np.random.default_rng([options.seed, number, 85])
    low, high = np.log(STIFFNESS_KPA)
    stiffness = np.exp(rng.uniform(low, high, 2)).round(1)
    effect = options.hide[number % len(options.hide)] if options.hide else None
    drawn = HIDE[effect](np.random.default_rng([options.seed, number, 87])) if effect else {}
    hidden = {effect: drawn} if drawn else {}
    changes = _changes(np.random.default_rng([options.seed, number, 88])) if number // len(options.scans) % 2 else ()
    # Were it the CT's own in all of them, the pairs of one CT would share half of their noise.
    rest_noise = "own" if number < len(options.scans) else "anew"
    reasons = []
    for _ in range(ATTEMPTS):
        plain = drawn_spec(ct.absolute(), labels.absolute(), stiffness, rng, changes, rest_noise)
        spec = {**plain, "hidden": hidden}
        if options.contour_error is not None:
            sd, length = options.contour_error
            spec |= {"contour_noise_sd_mm": sd, "noise_correlation_mm": length}
        shutil.rmtree(folder / "cases" / name, ignore_errors=True)
        try:
            truth = run_simulate(
                spec, folder / "cases" / name / "scans", folder / "truths" / name, mesh_cache=folder / "meshes"
            )
        except ConvergenceError as error:
            reasons.append(str(error))
            shutil.rmtree(folder / "cases" / name, ignore_errors=True)
            continue
        with atomic_path(answers / f"{name}.json") as temporary:
            temporary.write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")
        return True
    with atomic_path(folder / "unmade" / f"{name}.txt") as temporary:
        temporary.write_text("\n".join(reasons) + "\n", encoding="utf-8")
    return False


def unmade(folder: Path, name: str) -> list[str]:
    """Why a pair could not be made, one reason for each wall motion that was tried; empty where nothing says so."""
    said = folder / "unmade" / f"{name}.txt"
    return said.read_text(encoding="utf-8").splitlines() if said.exists() else []


def drawn_spec(
    ct: Path,
    labels: Path,
    stiffness: FloatArray,
    rng: np.random.Generator,
    changes: tuple[str, ...] = (),
    rest_noise: str = "own",
) -> Specification:
    """A specification of `palpate simulate`. stiffness : (2,) kPa, left and right. changes, rest_noise : as its `scan` has them."""
    aside = [float(rng.uniform(-ASIDE_MM, ASIDE_MM)), float(rng.uniform(*PUSH_MM)), 0.0]
    rectum = {
        "inflate_mm": float(rng.uniform(*INFLATE_MM)),
        "push_mm": aside,
        "half_length_mm": float(rng.uniform(*HALF_LENGTH_MM)),
    }
    return {
        "source": {"ct": str(ct), "labels": str(labels)},
        "stiffness_kpa": {"prostate_left": float(stiffness[0]), "prostate_right": float(stiffness[1])},
        "walls": {"contact": "gliding", "rectum": rectum},
        "contour_noise_sd_mm": CONTOUR_SD_MM,
        "noise_correlation_mm": float(rng.uniform(*CORRELATION_MM)),
        "mesh": {"edge_mm": EDGE_MM, "element": ELEMENT},
        "scan": {
            "shift_mm": rng.uniform(-SHIFT_MM, SHIFT_MM, 3).tolist(),
            "rotation_deg": rng.uniform(-TURN_DEG, TURN_DEG, 3).tolist(),
            "changes": list(changes),
            "rest_noise": rest_noise,
        },
        "seed": int(rng.integers(1, 2**31 - 1)),
    }


def _changes(rng: np.random.Generator) -> tuple[str, ...]:
    return tuple(change for change in CHANGES if rng.random() < CHANGE_SHARE)


def _inclusion(rng: np.random.Generator) -> Specification:
    return {
        "half": str(rng.choice(["prostate_left", "prostate_right"])),
        "offset_mm": rng.uniform(-OFFSET_MM, OFFSET_MM, 3).tolist(),
        "radius_mm": float(rng.uniform(*RADIUS_MM)),
        "factor": _factor(rng),
    }


def _uneven_tissue(rng: np.random.Generator) -> Specification:
    angle = rng.uniform(0.0, 2.0 * np.pi)
    return {
        "towards": [float(np.cos(angle)), float(np.sin(angle)), 0.0],
        "from_mm": float(rng.uniform(*FROM_MM)),
        "factor": _factor(rng),
    }


def _sliding(rng: np.random.Generator) -> Specification:
    return {"layer_mm": LAYER_MM, "softer": float(np.exp(rng.uniform(*np.log(SOFTER))))}


def _capsule(rng: np.random.Generator) -> Specification:
    return {"thickness_mm": float(rng.uniform(*RIND_MM)), "factor": _factor(rng)}


def _nothing(rng: np.random.Generator) -> Specification:
    return {}


def _factor(rng: np.random.Generator) -> float:
    size = float(np.exp(rng.uniform(*np.log(FACTOR))))
    return 1.0 / size if rng.random() < SOFT_SHARE else size


# What a pair can hide, by name: effects of `palpate simulate`, of which the diagnosis has no name for a capsule, or nothing.
HIDE: Mapping[str, Callable[[np.random.Generator], Specification]] = {
    "inclusion": _inclusion,
    "tissue_heterogeneity": _uneven_tissue,
    "interface_sliding": _sliding,
    "capsule": _capsule,
    "nothing": _nothing,
}
