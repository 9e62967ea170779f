"""The identify step of a case: mesh and surfaces to stiffness. The computation is a job in a worker process."""

from __future__ import annotations

from dataclasses import asdict, replace
from importlib import metadata
from pathlib import Path

import msgspec
from msgspec import UNSET

from palpate.case.case_data import data_of
from palpate.case.case_folder import CaseFolder
from palpate.case.identified import read_result
from palpate.case.matched import FILE as MATCHED
from palpate.case.matched import left_out, wants_image
from palpate.case.missing import at_bounds, missing_structures
from palpate.case.problem import noise_source
from palpate.case.steps import match, mesh
from palpate.case.steps.declarations import IDENTIFY
from palpate.case.steps.whole import make_whole
from palpate.case.surface_errors import StatedErrors
from palpate.core.files.json_types import typed
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.result_record import IdentificationRecord, ResultRecord
from palpate.core.residual.case_data import arrays_of_state
from palpate.core.residual.fit_options import INFERENCE
from palpate.core.worker.inline import DoJob
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Message
from palpate.core.worker.process import run_job
from palpate.core.worker.progress import Progress, part, silent

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


def run(
    case: CaseFolder, options: IdentifyOptions | None = None, progress: Progress = silent, do_job: DoJob = run_job
) -> ResultRecord:
    """Write result.json and identify/ of a case; return what result.json says.

    The step passes over a case whose inputs and options are those of the last run. A run that was killed goes on from
    its checkpoint. A case with labels and no mesh is meshed first; with `image` its CTs are matched. do_job : runs the
    job; a caller in a worker process gives `run_inline`. Raises InputError when labels are missing, ConvergenceError
    when nothing could be solved, Cancelled.
    """
    options = options or IdentifyOptions()
    if not case.has("mesh.json"):
        mesh.run(case, progress=part(progress, 0.0, 0.1))
    options = replace(options, image=wants_image(case, options.image))
    chosen = {k: v for k, v in asdict(options).items() if k not in ("workers", "image")} | {"inference": INFERENCE}
    without = left_out(match.run(case, progress=part(progress, 0.0, 0.1))) if options.image else ""
    if without:
        options = replace(options, image=False)
        chosen["image"] = without
    if options.image:
        chosen["image"] = case.inputs_sha256([MATCHED]) if case.has(MATCHED) else ""
    made_from = IDENTIFY.made_from(case, chosen)
    if IDENTIFY.is_done(case, made_from):
        return read_result(case)
    make_whole(case, part(progress, 0.0, 0.1))
    folder = case.file("identify")
    paths = _write_problems(case, folder, options)
    answer = do_job(_job(case, options, paths), lambda m: _tell(m, progress))
    result = _of_case(
        case, typed(answer, IdentificationRecord, "the worker's answer", ""), bool(options.image), without
    )
    case.write_json("result.json", result)
    IDENTIFY.mark_done(case, made_from)
    progress(1.0, "stiffness found")
    return result


def _of_case(case: CaseFolder, record: IdentificationRecord, image: bool, without: str) -> ResultRecord:
    """The job's record completed by the case: versions, hashes of inputs, source of the contours' noise. without : why the images are
    left out, "" where they are not.
    """
    fields = {name: getattr(record, name) for name in record.__struct_fields__}
    misfit = msgspec.structs.replace(record.misfit, contour_noise_from=noise_source(case))
    return ResultRecord(
        **{**fields, "misfit": misfit},
        versions=versions(),
        inputs_sha256=_input_hashes(case),
        simulated=True if case.facts.other.get("simulated") else UNSET,
        missing=[*[without] * bool(without), *missing_structures(case, image), *at_bounds(record.parameters)],
        contour_errors_mm=StatedErrors(case).rms_mm() or UNSET,
    )


def versions() -> dict[str, str]:
    """Versions of the packages that a result depends on."""
    out = {}
    for name in _PACKAGES:
        try:
            out[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            out[name] = "absent"
    return out


def _write_problems(case: CaseFolder, folder: Path, options: IdentifyOptions) -> dict[str, str]:
    """Write problem.npz, and problem_2.npz, ... for further states; return paths by role. Files of removed states are
    deleted.
    """
    folder.mkdir(parents=True, exist_ok=True)
    pairs = data_of(case, bool(options.image), options.law).pairs
    states = {"problem" if k == 1 else f"problem_{k}": state for k, state in enumerate(pairs, 1)}
    for old in folder.glob("problem_*.npz"):
        if old.stem not in states:
            case.remove(f"identify/{old.name}")
    for name, state in states.items():
        case.write_npz(f"identify/{name}.npz", **arrays_of_state(*state))
    return {name: str(folder / f"{name}.npz") for name in states}


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
    """Progress of the step at a fraction of its job; the first tenth is the mesh's."""
    return 0.1 + 0.88 * float(fraction)


def _tell(message: Message, progress: Progress) -> None:
    if message.get("type") == "progress":
        progress(overall(message["fraction"]), str(message["message"]))


def _input_hashes(case: CaseFolder) -> dict[str, str]:
    names = ("rest.nii.gz", "deformed.nii.gz", *IDENTIFY.inputs(case))
    return {name: case.inputs_sha256([name]) for name in names if case.has(name)}
