"""The specification of a simulation (SPEC.json), read and checked.

Every key may be left out but ``stiffness_kpa`` and ``walls``; the example shows the defaults where there are any:

    {"name": "made-up",                       the case's name; the folder's by default
     "source": "phantom",                     or {"case": FOLDER}, or {"ct": FOLDER, "labels": RTSTRUCT or label volume}
     "stiffness_kpa": {"prostate_left": 15, "prostate_right": 42},           true shear moduli G, every organ label present
     "tissue_kpa": 20, "tissue_poisson_ratio": 0.49, "mu1_share": 0.5,
     "walls": {"contact": "gliding",          or "tied": every point of a wall goes where the motion says
               "rectum": {"inflate_mm": 9, "bias": [0, 0], "push_mm": [0, 0, 0], "middle_mm": 0, "half_length_mm": 36},
               "bladder": {"balance": 0.9, "volume_change_cc": null, "push_mm": [0, 0, 0]}},
     "hidden": {},                            what no analysis is told: "inclusion", "tissue_heterogeneity", "interface_sliding",
                                               "capsule"
     "contour_noise_sd_mm": 0, "noise_correlation_mm": 8,
     "mesh": {"edge_mm": 3.7, "element": "p2"},
     "scan": {"shift_mm": [0, 0, 0], "rotation_deg": [0, 0, 0], "voxel_mm": [1.2, 1.2, 2], "noise_hu": 12, "blur_mm": 0.5},
     "output": "dicom",                       CT pair and contours; or "labels": label volumes only
     "seed": 1}

docs/simulate.md explains it for users; `simulate.walls` explains the numbers of the walls. Paths are relative to the
SPEC.json.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from msgspec import UNSET, structs

from palpate.case.steps.simulate.from_ct import CtSource
from palpate.case.steps.simulate.spec_file import HiddenFile, ScanFile, SpecFile
from palpate.core.errors import InputError
from palpate.core.files.json_file import read_json
from palpate.core.files.json_types import plain, refusal, typed
from palpate.imaging.labels import LABEL_VALUES
from palpate.simulate.hidden_effects import Capsule, HiddenEffect, Inclusion, SlidingOrgan, UnevenTissue
from palpate.simulate.stiffness import Stiffness
from palpate.simulate.walls import BladderSpec, RectumSpec

_SOURCE = "simulation spec"


@dataclass(frozen=True)
class SimulationSpec:
    """Checked specification, see the module. source : "phantom", the path of a case, or a CT with contours. raw : as
    written.
    """

    source: str | Path | CtSource
    stiffness: Stiffness
    rectum: RectumSpec | None
    bladder: BladderSpec | None
    contact: str = "gliding"
    hidden: tuple[HiddenEffect, ...] = ()
    name: str | None = None
    contour_noise_sd_mm: float = 0.0
    noise_correlation_mm: float = 8.0
    edge_mm: float = 3.7
    element: str = "p2"
    scan: ScanFile = field(default_factory=ScanFile)
    output: str = "dicom"
    seed: int = 1
    raw: Mapping[str, object] = field(default_factory=dict)


def load_spec(path: Path | str) -> dict[str, object]:
    """The JSON object of a SPEC.json. Raises InputError naming the file when it is missing or no JSON object."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path} cannot be read; give the path of a simulation's SPEC.json")
    data = read_json(path)
    if not isinstance(data, dict):
        raise InputError(f"{path} holds no JSON object; docs/simulate.md tells its form")
    return data


def parse_spec(data: Mapping[str, object], base: Path | None = None) -> SimulationSpec:
    """The checked specification. base : folder that relative paths start from.

    Raises InputError, one line: the property, its value and what is allowed.
    """
    file = typed(data, SpecFile, _SOURCE, "")
    walls, organ = file.walls, plain(file.stiffness_kpa)
    if walls.rectum is UNSET and walls.bladder is UNSET:
        raise refusal(SpecFile, "walls", data["walls"], _SOURCE, "")
    if not organ:
        raise refusal(SpecFile, "stiffness_kpa", organ, _SOURCE, "")
    G = {LABEL_VALUES[name]: float(str(value)) for name, value in organ.items()}
    return SimulationSpec(
        source=_source(file, base or Path()),
        stiffness=Stiffness(G, file.tissue_kpa, file.tissue_poisson_ratio, file.mu1_share),
        rectum=None if walls.rectum is UNSET else RectumSpec(**structs.asdict(walls.rectum)),
        bladder=None if walls.bladder is UNSET else BladderSpec(**structs.asdict(walls.bladder)),
        contact=walls.contact,
        hidden=_hidden(file.hidden),
        name=file.name,
        contour_noise_sd_mm=file.contour_noise_sd_mm,
        noise_correlation_mm=file.noise_correlation_mm,
        edge_mm=file.mesh.edge_mm,
        element=file.mesh.element,
        scan=file.scan,
        output=file.output,
        seed=int(file.seed),
        raw=dict(data),
    )


def _hidden(file: HiddenFile) -> tuple[HiddenEffect, ...]:
    found: list[HiddenEffect] = []
    if file.inclusion is not UNSET:
        ball = file.inclusion
        found.append(Inclusion(LABEL_VALUES[ball.half], ball.offset_mm, ball.radius_mm, ball.factor))
    if file.tissue_heterogeneity is not UNSET:
        tissue = file.tissue_heterogeneity
        if not any(tissue.towards):
            raise InputError(f"{_SOURCE}: hidden.tissue_heterogeneity.towards is [0, 0, 0]; give a direction")
        found.append(UnevenTissue(tissue.towards, tissue.from_mm, tissue.factor))
    if file.interface_sliding is not UNSET:
        found.append(SlidingOrgan(file.interface_sliding.layer_mm, file.interface_sliding.softer))
    if file.capsule is not UNSET:
        found.append(Capsule(file.capsule.thickness_mm, file.capsule.factor))
    return tuple(found)


def _source(file: SpecFile, base: Path) -> str | Path | CtSource:
    given = file.source
    if isinstance(given, str):
        return given
    if set(given) == {"case"}:
        return base / given["case"]
    if set(given) == {"ct", "labels"}:
        return CtSource(base / given["ct"], base / given["labels"])
    raise refusal(SpecFile, "source", given, _SOURCE, "")
