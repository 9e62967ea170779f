"""The identify step of a case: mesh and surfaces to stiffness, in a worker process."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.case.deformed_states import further_states, state_labels, state_landmarks
from palpate.case.steps import mesh
from palpate.case.steps.measure_contour_noise import FILE as NOISE_FILE
from palpate.case.steps.measure_contour_noise import measured_noise
from palpate.case.steps.mesh import ORGAN_NAME, elsewhere_of, load_meshed, load_surfaces
from palpate.core.errors import InputError
from palpate.core.identify.options import IdentifyOptions
from palpate.core.problem import Facts, IdentificationProblem, Surface, SurfacePair
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Message
from palpate.core.worker.process import run_job
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.labels import LABELS
from palpate.meshing.label_surfaces import TriSurface, organ_surfaces, wall_surface
from palpate.meshing.partition import HOLE_NAMES

INPUTS = ("mesh.npz", "surfaces.npz", "case.json", "landmarks.csv")
# Standard deviation of a contour when nobody says: about what two observers of one CT differ by (DESIGN.md).
DEFAULT_NOISE_MM = 0.4
_WALLS = ("bladder", "rectum")
_ORGAN = (1, 2)
_PACKAGES = (
    "palpate",
    "numpy",
    "scipy",
    "numba",
    "pypardiso",
    "vtk",
    "pyvista",
    "pytetwild",
    "scikit-image",
    "SimpleITK",
)


@dataclass(frozen=True)
class IdentifyStepOptions:
    """identify : what the worker does. on_message : sees every message of the worker. cancel : set it to stop."""

    identify: IdentifyOptions = field(default_factory=IdentifyOptions)
    on_message: Callable[[Message], None] | None = None
    cancel: threading.Event | None = None


def run(case: CaseFolder, options: IdentifyStepOptions | None = None, progress: Progress = silent) -> dict[str, Any]:
    """Write result.json and identify/ of a case; return what result.json says.

    Nothing is done when inputs and options are those of the last run; a run that was killed goes on from its checkpoint.
    A case that has labels but no mesh yet is meshed first.
    Raises InputError when labels are missing, ConvergenceError when nothing could be solved, Cancelled.
    """
    options = options or IdentifyStepOptions()
    if not case.has("mesh.json"):
        mesh.run(case, progress=lambda f, m: progress(0.1 * f, m))
    chosen = {k: v for k, v in asdict(options.identify).items() if k != "workers"}
    inputs = case.inputs_sha256((*INPUTS, *further_files(case)), chosen)
    if case.step_is_done("identify", inputs):
        done: dict[str, Any] = case.read_json("result.json")
        return done
    folder = case.file("identify")
    paths = _write_problems(case, folder)
    found = run_job(
        _job(case, options.identify, paths), lambda m: _tell(m, progress, options.on_message), options.cancel
    )
    result = {**found, "versions": versions(), "inputs_sha256": _input_hashes(case)}
    result["misfit"]["contour_noise_from"] = _noise_from(case)
    if case.facts.other.get("simulated"):
        result["simulated"] = True
    case.write_json("result.json", result)
    case.mark_done("identify", inputs, ("result.json", "identify/fields.npz"))
    progress(1.0, "stiffness found")
    return result


def problem_of(case: CaseFolder) -> IdentificationProblem:
    """The case's mesh, walls and organ surfaces as one numerical problem. Raises InputError when a step before is missing."""
    meshed = load_meshed(case)
    rest, deformed = load_surfaces(case, "rest"), load_surfaces(case, "deformed")
    for state, surfaces in (("rest", rest), ("deformed", deformed)):
        if ORGAN_NAME not in surfaces:
            raise InputError(f"{case.file('surfaces.npz')} has no organ in the {state} state; run `palpate mesh` again")
    walls = {n: SurfacePair(_plain(rest[n]), _plain(deformed[n])) for n in _WALLS if n in rest and n in deformed}
    present = sorted(set(np.unique(meshed.mesh.regions).tolist()) & set(_ORGAN))
    marks = case.landmarks()
    elsewhere = elsewhere_of(case)
    if marks is not None and elsewhere is not None:
        marks = replace(marks, deformed=elsewhere.back(marks.deformed))
    landmarks = np.zeros((0, 6)) if marks is None else np.hstack([marks.rest, marks.deformed])
    return IdentificationProblem(
        meshed.mesh,
        meshed.boundary,
        walls,
        SurfacePair(_plain(rest[ORGAN_NAME]), _plain(deformed[ORGAN_NAME])),
        facts_of(case),
        {r: LABELS[r] for r in present},
        landmarks,
    )


def versions() -> dict[str, str]:
    """Versions of the packages that an answer depends on."""
    out = {}
    for name in _PACKAGES:
        try:
            out[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            out[name] = "absent"
    return out


def facts_of(case: CaseFolder) -> Facts:
    """The scalars of a case that the model needs; the contours' error as stated, else as measured from repeats, else assumed."""
    facts = case.facts
    measured = None if facts.boundary_noise_sd_mm is not None else measured_noise(case)
    sd, length = measured or (facts.boundary_noise_sd_mm or DEFAULT_NOISE_MM, Facts.noise_correlation_mm)
    return Facts(
        tissue_shear_modulus_kpa=facts.tissue_shear_modulus_kpa,
        tissue_poisson_ratio=facts.tissue_poisson_ratio,
        bounds_kpa=facts.organ_shear_modulus_bounds_kpa,
        noise_sd_mm=sd,
        noise_correlation_mm=length,
        outer_fixed=facts.outer_surface == "fixed",
    )


def _noise_from(case: CaseFolder) -> str:
    if case.facts.boundary_noise_sd_mm is not None:
        return "case"
    return "assumed" if measured_noise(case) is None else "repeats"


def _plain(surface: TriSurface) -> Surface:
    return Surface(surface.points, surface.faces, surface.region)


def state_problems(case: CaseFolder, first: IdentificationProblem) -> list[IdentificationProblem]:
    """Those of the case's further deformed states: the mesh, walls and organ at rest of the first, what each shows of itself."""
    out = []
    for state in further_states(case):
        labels, marks = state_labels(case, state), state_landmarks(case, state)
        seen = {name: _plain(wall_surface(labels, label)) for label, name in HOLE_NAMES.items() if name in first.walls}
        walls = {n: SurfacePair(first.walls[n].rest, surface) for n, surface in seen.items() if len(surface.faces)}
        organ = SurfacePair(first.organ.rest, _plain(organ_surfaces(labels)))
        landmarks = np.zeros((0, 6)) if marks is None else np.hstack([marks.rest, marks.deformed])
        out.append(replace(first, walls=walls, organ=organ, landmarks=landmarks))
    return out


def further_files(case: CaseFolder) -> list[str]:
    """What only some cases have: further deformed states, and how well contours repeat."""
    noise = [NOISE_FILE] if case.has(NOISE_FILE) else []
    return [*(name for state in further_states(case) for name in state.files), *noise]


def _write_problems(case: CaseFolder, folder: Path) -> dict[str, str]:
    """problem.npz, and problem_2.npz and so on for further states; their paths by role. Those of states that are gone go too."""
    folder.mkdir(parents=True, exist_ok=True)
    first = problem_of(case)
    problems = {"problem": first}
    problems |= {f"problem_{k}": problem for k, problem in enumerate(state_problems(case, first), 2)}
    for old in folder.glob("problem_*.npz"):
        if old.stem not in problems:
            case.remove(f"identify/{old.name}")
    for name, problem in problems.items():
        case.write_npz(f"identify/{name}.npz", **problem.arrays())
    return {name: str(folder / f"{name}.npz") for name in problems}


def _job(case: CaseFolder, options: IdentifyOptions, paths: dict[str, str]) -> Job:
    chosen = {k: v for k, v in asdict(options).items() if k not in ("seed", "workers")}
    folder = case.file("identify")
    job = Job(
        "palpate.core.identify.job:run",
        str(folder),
        paths,
        chosen,
        options.seed,
        options.workers,
    )
    job.save(folder / "job.json")
    return job


def overall(fraction: float) -> float:
    """The fraction of the whole step that a fraction of the worker's job stands for."""
    return 0.1 + 0.88 * float(fraction)


def _tell(message: Message, progress: Progress, on_message: Callable[[Message], None] | None) -> None:
    if message.get("type") == "progress":
        progress(overall(message["fraction"]), str(message["message"]))
    if on_message is not None:
        on_message(message)


def _input_hashes(case: CaseFolder) -> dict[str, str]:
    names = ("rest.nii.gz", "deformed.nii.gz", *INPUTS, *further_files(case))
    return {name: case.inputs_sha256([name]) for name in names if case.has(name)}
