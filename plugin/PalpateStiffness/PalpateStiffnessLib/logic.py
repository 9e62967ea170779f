"""What the module does: load a pair, segment, find the stiffness, show it. No GUI, no Qt."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from .errors import InputError
from .mrml import MrmlNode, MrmlScene
from .nodes import STATES, ResultNodes, show
from .pipeline import Pipeline, Step
from .program import program_command
from .scene_inputs import dicom_folder, segmentation_file

ORGANS = ("prostate", "bladder", "rectum", "urethra")
METHODS = ("swarm", "gauss-newton")


class StiffnessLogic:
    """scene : where results are shown. program : the palpate program, found where empty.

    The program does all work in child processes and keeps everything in the case folder, so a scene that is closed or a
    Slicer that is killed loses nothing: the same steps pass over what is done.
    """

    def __init__(self, scene: MrmlScene, program: str = "") -> None:
        self.scene, self.program = scene, program
        self._exports: list[str] = []

    def load_pair(
        self,
        rest: Path,
        deformed: Path,
        case: Path,
        aligned: bool = False,
        labels: tuple[Path | None, Path | None] = (None, None),
    ) -> Pipeline:
        """Imports two DICOM folders as a case, aligned on bone. aligned : they lie in one frame already. labels : files with contours
        of the scan at rest and of the deformed one."""
        for folder, what in ((rest, "scan at rest"), (deformed, "deformed scan")):
            # An empty field is `.` in Slicer's parameter node.
            if folder == Path() or not folder.is_dir():
                raise InputError(f"Choose the folder of the {what}; {folder} is none.")
        options = ["--no-align"] if aligned else []
        for state, path in zip(("rest", "deformed"), labels, strict=True):
            options += [] if path is None else [f"--{state}-labels", str(path)]
        return Pipeline([self._step("import", str(rest), str(deformed), "-o", str(case), *options)])

    def segment(self, case: Path, seeds: MrmlNode = None) -> Pipeline:
        """Finds the organs in both scans. seeds : a point list node, its points named by organ, in the scan at rest."""
        points = [text for seed in seeds_of(seeds) for text in ("--seed", seed)]
        return Pipeline([self._step("segment", self._case(case), *points)])

    def identify(self, case: Path, method: str = METHODS[0], options: Sequence[str] = (), tets: int = 4000) -> Pipeline:
        """Mesh and stiffness. options : further options of `palpate identify`."""
        if method not in METHODS:
            raise InputError(f"The method {method!r} is unknown; choose {' or '.join(METHODS)}.")
        folder = self._case(case)
        mesh = self._step("mesh", folder, "--tets", str(tets), share=0.3)
        return Pipeline([mesh, self._step("identify", folder, "--method", method, *options, share=1.0)])

    def diagnose(self, case: Path) -> Pipeline:
        """Looks for what the model leaves out."""
        return Pipeline([self._step("diagnose", self._case(case))])

    def corrected(self, case: Path, nodes: ResultNodes, aligned: bool = False) -> tuple[Pipeline, Path]:
        """The segments of the scene, as they are now, back into a new case beside the old one: the pipeline and that case.

        Raises InputError where the case has no scans or the scene no segments of it.
        """
        self._case(case)
        if not all((case / f"{state}_ct").is_dir() for state in STATES):
            raise InputError(f"{case} has not got both scans; segments can be given back to a pair of scans only.")
        if not nodes.segmentations:
            raise InputError(
                "There are no segments of this case in the scene; press Show in the scene first, then correct them."
            )
        new = free_folder(case)
        labels = [
            segmentation_file(self.scene, nodes.segmentations[state], self._scratch() / f"{state}_labels.seg.nrrd")
            if state in nodes.segmentations else None for state in STATES
        ]  # fmt: skip
        pair = self.load_pair(case / "rest_ct", case / "deformed_ct", new, aligned, (labels[0], labels[1]))
        return Pipeline([*pair.steps, self._step("segment", str(new))]), new

    def scan_folder(self, folder: Path, volume: MrmlNode) -> Path:
        """The folder of a scan: as chosen, else of the files that a volume of the scene was loaded from. Raises InputError."""
        if folder != Path() or volume is None:
            return folder
        import slicer

        return dicom_folder(volume, slicer.dicomDatabase, self._scratch() / "scan")

    def contours(self, segmentation: MrmlNode) -> Path | None:
        """A segmentation of the scene as a file with contours; None where there is none. Raises InputError."""
        return (
            None
            if segmentation is None
            else segmentation_file(self.scene, segmentation, self._scratch() / "contours.seg.nrrd")
        )

    def report(self, case: Path) -> Pipeline:
        """The report as HTML and PDF in the case."""
        return Pipeline([self._step("report", self._case(case))])

    def export(self, case: Path) -> tuple[Pipeline, Path]:
        """Writes what ``show_results`` reads into a folder of its own: the pipeline and that folder."""
        folder = self._scratch()
        steps = [self._step("export", self._case(case), "--to", "nrrd", str(folder))]
        if (case / "mesh.npz").is_file():
            steps.append(self._step("export", str(case), "--to", "vtu", str(folder)))
        return Pipeline(steps), folder

    def show_results(self, folder: Path, earlier: ResultNodes | None = None) -> ResultNodes:
        """Shows an export in the scene in the place of an earlier one."""
        nodes = show(self.scene, folder)
        for node in earlier.all() if earlier is not None else ():
            self.scene.RemoveNode(node)
        return nodes

    def clean(self) -> None:
        """Removes the export folders; saving a scene copies what it needs."""
        for folder in self._exports:
            shutil.rmtree(folder, ignore_errors=True)
        self._exports.clear()

    def _step(self, name: str, *arguments: str, share: float = 1.0) -> Step:
        return Step(name, [*program_command(self.program), name, *arguments], share)

    def _case(self, case: Path) -> str:
        if not (case / "case.json").is_file():
            raise InputError(f"{case} is no case; load a pair first or choose the folder of a case.")
        return str(case)

    def _scratch(self) -> Path:
        """A new folder that `clean` removes."""
        folder = Path(tempfile.mkdtemp(prefix="palpate-", dir=self._temporary()))
        self._exports.append(str(folder))
        return folder

    def _temporary(self) -> str | None:
        import slicer

        application = getattr(slicer, "app", None)
        return None if application is None else str(application.temporaryPath)


def free_folder(case: Path) -> Path:
    """A folder beside a case that is not there yet."""
    number = 1
    while (path := case.with_name(f"{case.name}_corrected_{number}")).exists():
        number += 1
    return path


def seeds_of(points: MrmlNode) -> list[str]:
    """Control points as the program takes them, NAME=X,Y,Z in LPS mm. Their labels must be organs; a count after is allowed.

    Raises InputError naming the point whose label is none.
    """
    found = []
    for index in range(points.GetNumberOfControlPoints() if points is not None else 0):
        label = points.GetNthControlPointLabel(index)
        organ = re.sub(r"[-_ ]*\d*$", "", label.strip().lower())
        if organ not in ORGANS:
            raise InputError(f"The point {label!r} must be named after what it lies in: {', '.join(ORGANS)}.")
        x, y, z = points.GetNthControlPointPositionWorld(index)
        found.append(f"{organ}={-x:.2f},{-y:.2f},{z:.2f}")
    return found
