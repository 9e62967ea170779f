"""The diagnose step of a case: which effect the plain model leaves out. The computation is a job in a worker
process.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from msgspec import UNSET, structs

from palpate.case.bench.body import body_problem, surface_notes
from palpate.case.case_data import data_of
from palpate.case.case_folder import CaseFolder, file_sha256
from palpate.case.deformed_states import state_rigid_offset
from palpate.case.diagnosed import DIAGNOSIS, read_diagnosis
from palpate.case.identified import read_result
from palpate.case.matched import left_out, wants_image
from palpate.case.meshed import rigid_offset_of
from palpate.case.missing import missing_structures
from palpate.case.stated_files import further_states, is_body
from palpate.case.steps import match, mesh
from palpate.case.steps.declarations import DIAGNOSE
from palpate.case.steps.whole import make_whole
from palpate.core.diagnose.diagnosis_record import DiagnosisRecord
from palpate.core.diagnose.options import DiagnosisOptions
from palpate.core.errors import ConvergenceError
from palpate.core.files.json_types import typed
from palpate.core.identify.options import IdentifyOptions
from palpate.core.residual.case_data import arrays
from palpate.core.residual.fit_file import FILE
from palpate.core.residual.fit_options import INFERENCE
from palpate.core.residual.remeshing import Remeshed
from palpate.core.worker.inline import DoJob
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Message
from palpate.core.worker.process import run_job
from palpate.core.worker.progress import Progress, part, silent
from palpate.meshing.mesh_labels import MeshOptions, mesh_labels

_FOLDER = "diagnose"
_KIND, _BODY_KIND = "palpate.core.diagnose.job:run", "palpate.core.diagnose.bench_bodies.diagnose:run"


@dataclass(frozen=True)
class DiagnoseOptions:
    """effects : folder of a user's own effects. seed : of bootstraps and placebos. meshes : number of meshes to average
    over.

    numbers : noise model, wall motion and decision rules. image : use the motion that the two CTs' images tell, where
    the case has both; None: as `identify` did, and where it did not run, as it would (`case.matched.wants_image`).
    law : of the organ; None: as `identify` took. Raises InputError where there is none of that name.
    """

    effects: Path | None = None
    seed: int = 1
    meshes: int = 1
    numbers: DiagnosisOptions = field(default_factory=DiagnosisOptions)
    image: bool | None = None
    law: str | None = None

    def __post_init__(self) -> None:
        if self.law is not None:
            IdentifyOptions(law=self.law)


def run(
    case: CaseFolder, options: DiagnoseOptions | None = None, progress: Progress = silent, do_job: DoJob = run_job
) -> DiagnosisRecord:
    """Write diagnosis.json and diagnose/ of a case; return what diagnosis.json says.

    The job starts from the plain fit that `identify` keeps in the case, or fits the same anew where there is none of
    these inputs. Of result.json only the organ's law and whether it stands on the images are read; it is not written.
    A case with labels and no mesh is meshed first. A body on a bench (`bench_body`) has a job of its own. The step
    passes over a case whose inputs and options are those of the last run. do_job : runs the job; a caller in a worker
    process gives `run_inline`. Raises InputError when labels are missing or result.json is damaged, ConvergenceError
    when nothing could be solved, Cancelled.
    """
    options = options or DiagnoseOptions()
    body = is_body(case)
    if not body and not case.has("mesh.json"):
        mesh.run(case, progress=part(progress, 0.0, 0.2))
    identified = _as_identified(case)
    law = IdentifyOptions.law if body else options.law or identified.law
    image = not body and wants_image(case, identified.image if options.image is None else options.image)
    without = left_out(match.run(case, progress=part(progress, 0.2, 0.3))) if image else ""
    image = image and not without
    made_from = DIAGNOSE.made_from(case, _chosen(options, image, law))
    if DIAGNOSE.is_done(case, made_from):
        return read_diagnosis(case)
    make_whole(case, part(progress, 0.2, 0.3))
    case.file(_FOLDER).mkdir(parents=True, exist_ok=True)
    others = () if body else remeshed(case, options.meshes - 1, part(progress, 0.3, 0.4))
    given = body_problem(case).arrays() if body else arrays(replace(data_of(case, image, law), remeshed=others))
    case.write_npz(f"{_FOLDER}/data.npz", **given)
    answer = do_job(_job(case, options, _BODY_KIND if body else _KIND), lambda m: _tell(m, part(progress, 0.4, 1.0)))
    notes = surface_notes(case) if body else [*filter(None, [without]), *_pelvis_notes(case, image)]
    record = _of_case(case, typed(answer, DiagnosisRecord, "the worker's answer", ""), notes)
    record = structs.replace(record, image=UNSET if body else image, law=UNSET if law == IdentifyOptions.law else law)
    case.write_json(DIAGNOSIS, record)
    DIAGNOSE.mark_done(case, made_from, (DIAGNOSIS, record.where.map))
    return record


def _chosen(options: DiagnoseOptions, image: bool, law: str) -> dict[str, object]:
    """What was chosen, for the hash of what the step was made from; what is as usual is left out."""
    own = {p.name: file_sha256(p) for p in sorted(options.effects.glob("*.py"))} if options.effects else {}
    chosen: dict[str, object] = {"seed": options.seed, "effects": own, "meshes": options.meshes, "inference": INFERENCE}
    if options.numbers != DiagnosisOptions():
        chosen["numbers"] = options.numbers.to_json()
    if image:
        chosen["image"] = True
    if law != IdentifyOptions.law:
        chosen["law"] = law
    return chosen


def _as_identified(case: CaseFolder) -> IdentifyOptions:
    """How the stiffness in result.json was found; the usual options where nothing was identified."""
    options = read_result(case).options if case.has("result.json") else UNSET
    return IdentifyOptions() if options is UNSET else options


def _pelvis_notes(case: CaseFolder, image: bool) -> list[str]:
    return [*missing_structures(case, image), *rigid_offset_notes(case)]


def _of_case(case: CaseFolder, record: DiagnosisRecord, flags: list[str]) -> DiagnosisRecord:
    """The record completed by the case: its flags first, whether it is simulated, the map's path from the case folder."""
    return structs.replace(
        record,
        where=structs.replace(record.where, map=f"{_FOLDER}/{record.where.map}"),
        flags=[*flags, *record.flags],
        simulated=True if case.facts.other.get("simulated") else UNSET,
    )


def rigid_offset_notes(case: CaseFolder) -> list[str]:
    """A line for each deformed scan of a meshed case that had a rigid offset."""
    first = rigid_offset_of(case)
    notes = [] if first is None else [first.words()]
    further = ((state.name, state_rigid_offset(case, state)) for state in further_states(case))
    return notes + [offset.words(f"the scan {name!r}") for name, offset in further if offset is not None]


def remeshed(case: CaseFolder, count: int, progress: Progress = silent) -> tuple[Remeshed, ...]:
    """`count` further meshes of the labels at rest, as fine as the case's own; none where the case has a mesh but no
    labels.

    A mesh that cannot be made is left out.
    """
    if not case.has_labels("rest"):
        return ()
    asked = case.read_json("mesh.json").get("options", {})
    own = MeshOptions(**{key: value for key, value in asked.items() if key in MeshOptions.__dataclass_fields__})
    out = []
    for k in range(count):
        progress(k / count, f"mesh {k + 2} of {count + 1}")
        try:
            made = mesh_labels(case.labels("rest"), replace(own, seed=own.seed + k + 1), case.file(_FOLDER) / "meshes")
        except ConvergenceError:
            continue
        out.append(Remeshed(made.mesh, made.boundary))
    return tuple(out)


def _job(case: CaseFolder, options: DiagnoseOptions, kind: str) -> Job:
    folder = case.file(_FOLDER)
    effects = None if options.effects is None else str(options.effects.resolve())
    job = Job(
        kind,
        str(folder),
        {"data": str(folder / "data.npz")},
        {
            "case": case.facts.name,
            "fit": str(case.file("identify") / FILE),
            "effects": effects,
            "numbers": options.numbers.to_json(),
        },
        options.seed,
        1,
    )
    job.save(folder / "job.json")
    return job


def _tell(message: Message, progress: Progress) -> None:
    if message.get("type") == "progress":
        progress(float(message["fraction"]), str(message["message"]))
