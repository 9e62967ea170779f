"""What the window asks its worker to do: steps with typed options, the same that the command line would have made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

import msgspec
import numpy as np

from palpate.case.case_folder import STATES
from palpate.case.steps.import_scans.options import ImportOptions
from palpate.case.steps.segment_options import SegmentOptions
from palpate.case.steps.step import Step
from palpate.core.arrays import FloatArray
from palpate.core.identify.options import IdentifyOptions
from palpate.core.worker.executors import cores
from palpate.segmentation.prompts import Prompts
from palpate.ui.desktop.session.steps import BY_COMMAND

# Decimals of a seed, mm: what is written in the case's history finds the same again.
_DECIMALS = 3


class RequestData(TypedDict):
    """A `StepRequest` as JSON."""

    step: str
    case: str
    options: object
    typed: str
    scans: list[str] | None


@dataclass(frozen=True, eq=False)
class StepRequest:
    """step : the declared one. options : of its type; None for the usual ones. typed : the options as a person would type them, without
    paths. scans : of an import, the one at rest and the deformed one."""

    step: Step
    case: Path
    options: object = None
    typed: str = "CASE"
    scans: tuple[Path, Path] | None = None

    def to_dict(self) -> RequestData:
        """JSON-able form."""
        return {
            "step": self.step.name,
            "case": str(self.case),
            "options": msgspec.to_builtins(self.options, enc_hook=_encoded),
            "typed": self.typed,
            "scans": None if self.scans is None else [str(path) for path in self.scans],
        }

    @classmethod
    def from_dict(cls, data: RequestData) -> StepRequest:
        """The inverse of `to_dict`. Raises msgspec.ValidationError where the options are not of the step's type."""
        step = BY_COMMAND[data["step"]].declared
        options = data["options"]
        if options is not None:
            options = msgspec.convert(options, step.options_type(), dec_hook=_decoded)
        scans = None if data["scans"] is None else (Path(data["scans"][0]), Path(data["scans"][1]))
        return cls(step, Path(data["case"]), options, data["typed"], scans)


def import_request(
    rest: Path,
    deformed: Path,
    case: Path,
    labels: tuple[Path | None, Path | None] = (None, None),
    series: Mapping[str, str] | None = None,
    rois: Mapping[str, Mapping[str, Sequence[str]]] | None = None,
) -> StepRequest:
    """Two folders to a case. labels : contours of the scan at rest and of the deformed one. series, rois : chosen ones, by state."""
    series, rois = series or {}, rois or {}
    rest_labels, deformed_labels = (None if path is None else path.absolute() for path in labels)
    given = [f"--{state}-labels FILE" for state, path in zip(STATES, labels, strict=True) if path is not None]
    given += [f"--{state}-series {name}" for state, name in series.items()]
    typed = " ".join(["REST DEFORMED", "-o CASE", *given])
    options = ImportOptions(
        series=(series.get("rest"), series.get("deformed")),
        labels=(rest_labels, deformed_labels),
        rois=(rois.get("rest", {}), rois.get("deformed", {})),
    )
    step = BY_COMMAND["import"].declared
    return StepRequest(step, case.absolute(), options, typed, (rest.absolute(), deformed.absolute()))


def step_request(
    command: str, case: Path, seeds: Mapping[str, Mapping[str, Sequence[float]]], deformed_to_rest: FloatArray
) -> StepRequest:
    """One step of a case. seeds : of both states in the rest frame, mm; the step wants those of the deformed scan in its own."""
    step, folder = BY_COMMAND[command].declared, case.absolute()
    if command == "identify":
        return StepRequest(step, folder, IdentifyOptions(workers=cores()))
    if command != "segment":
        return StepRequest(step, folder)
    back = np.linalg.inv(deformed_to_rest)
    rest = {name: _rounded(np.asarray(point)) for name, point in seeds.get("rest", {}).items()}
    deformed = {
        name: _rounded(back[:3, :3] @ np.asarray(point) + back[:3, 3])
        for name, point in seeds.get("deformed", {}).items()
    }
    typed = ["CASE", *_typed("--seed", rest), *_typed("--deformed-seed", deformed)]
    return StepRequest(step, folder, SegmentOptions(Prompts(rest), Prompts(deformed)), " ".join(typed))


def _rounded(point: FloatArray) -> FloatArray:
    return np.array([float(f"{x:.{_DECIMALS}f}") for x in point])


def _typed(option: str, points: Mapping[str, FloatArray]) -> list[str]:
    return [f"{option} {name}={','.join(f'{x:.{_DECIMALS}f}' for x in point)}" for name, point in points.items()]


def _encoded(value: object) -> object:
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise NotImplementedError(f"{type(value).__name__} is no option")


def _decoded(wanted: type, value: object) -> object:
    if wanted is Path:
        return Path(str(value))
    if getattr(wanted, "__origin__", wanted) is np.ndarray:
        return np.array(value, dtype=np.float64)
    raise NotImplementedError(f"{wanted} is no option's type")
