"""SPEC.json as declared types: every key with its range and default (docs/simulate.md lists them for users)."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import UNSET, Meta, UnsetType

_Line = Annotated[str, Meta(pattern=r"^[^\n]*\S[^\n]*$(?!\n)", description="a text of one line")]
_Modulus = Annotated[float, Meta(ge=0.5, le=2000.0)]
_Push = Annotated[float, Meta(ge=-15.0, le=15.0)]
_Shift = Annotated[float, Meta(ge=-50.0, le=50.0)]
_Turn = Annotated[float, Meta(ge=-10.0, le=10.0)]
_Voxel = Annotated[float, Meta(ge=0.5, le=6.0)]
_Factor = Annotated[float, Meta(ge=0.02, le=50.0)]
_Component = Annotated[float, Meta(ge=-1.0, le=1.0)]
_Bias = Annotated[float, Meta(ge=-0.7, le=0.7)]


class _Part(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An object of the file; a key that is not declared is refused."""


class OrganFile(_Part, frozen=True):
    """True shear moduli G, kPa, of every organ label that the source holds."""

    prostate_left: _Modulus | UnsetType = UNSET
    prostate_right: _Modulus | UnsetType = UNSET


class RectumFile(_Part, frozen=True):
    """As `RectumSpec`."""

    inflate_mm: Annotated[float, Meta(ge=-10.0, le=25.0)] = 9.0
    bias: tuple[_Bias, _Bias] = (0.0, 0.0)
    push_mm: tuple[_Push, _Push, _Push] = (0.0, 0.0, 0.0)
    middle_mm: Annotated[float, Meta(ge=-60.0, le=60.0)] = 0.0
    half_length_mm: Annotated[float, Meta(ge=10.0, le=200.0)] = 36.0


class BladderFile(_Part, frozen=True):
    """As `BladderSpec`."""

    volume_change_cc: Annotated[float, Meta(ge=-400.0, le=400.0)] | None = None
    balance: Annotated[float, Meta(ge=0.0, le=1.5)] = 0.9
    push_mm: tuple[_Push, _Push, _Push] = (0.0, 0.0, 0.0)


class WallsFile(_Part, frozen=True):
    """Which walls move and how. contact : "tied" where every point of a wall goes where the motion says."""

    contact: Literal["gliding", "tied"] = "gliding"
    rectum: RectumFile | UnsetType = UNSET
    bladder: BladderFile | UnsetType = UNSET


class MeshFile(_Part, frozen=True):
    """edge_mm : on the organ's surface. element : not p1, which locks, and not the element that identifies."""

    edge_mm: Annotated[float, Meta(ge=2.0, le=12.0)] = 3.7
    element: Literal["p2", "p2p0"] = "p2"


class ScanFile(_Part, frozen=True):
    """How the phantom is scanned (voxel, noise, blur), how the patient lies in the second scan (shift, rotation), and what
    else differs in the second scan of a real CT (changes), whose noise at rest is its own or drawn anew (rest_noise)."""

    shift_mm: tuple[_Shift, _Shift, _Shift] = (0.0, 0.0, 0.0)
    rotation_deg: tuple[_Turn, _Turn, _Turn] = (0.0, 0.0, 0.0)
    voxel_mm: tuple[_Voxel, _Voxel, _Voxel] = (1.2, 1.2, 2.0)
    noise_hu: Annotated[float, Meta(ge=0.0, le=100.0)] = 12.0
    blur_mm: Annotated[float, Meta(ge=0.0, le=3.0)] = 0.5
    changes: tuple[Literal["contrast", "kernel", "noise", "streaks"], ...] = ()
    rest_noise: Literal["own", "anew"] = "own"


class InclusionFile(_Part, frozen=True):
    """As `Inclusion`."""

    half: Literal["prostate_left", "prostate_right"]
    factor: _Factor
    offset_mm: tuple[_Push, _Push, _Push] = (0.0, 0.0, 0.0)
    radius_mm: Annotated[float, Meta(ge=3.0, le=30.0)] = 8.0


class UnevenTissueFile(_Part, frozen=True):
    """As `UnevenTissue`."""

    towards: tuple[_Component, _Component, _Component]
    factor: _Factor
    from_mm: Annotated[float, Meta(ge=-40.0, le=40.0)] = 0.0


class SlidingFile(_Part, frozen=True):
    """As `SlidingOrgan`."""

    softer: Annotated[float, Meta(ge=1.0, le=200.0)]
    layer_mm: Annotated[float, Meta(ge=1.0, le=10.0)] = 3.0


class CapsuleFile(_Part, frozen=True):
    """As `Capsule`."""

    factor: _Factor
    thickness_mm: Annotated[float, Meta(ge=1.0, le=15.0)] = 4.0


class HiddenFile(_Part, frozen=True):
    """What no analysis is told, by the name that the diagnosis has for it; it has none for a capsule."""

    inclusion: InclusionFile | UnsetType = UNSET
    tissue_heterogeneity: UnevenTissueFile | UnsetType = UNSET
    interface_sliding: SlidingFile | UnsetType = UNSET
    capsule: CapsuleFile | UnsetType = UNSET


_Source = Annotated[
    Literal["phantom"] | dict[str, _Line],
    Meta(description='"phantom", {"case": FOLDER} or {"ct": FOLDER, "labels": FILE}'),
]
_Organ = Annotated[
    OrganFile,
    Meta(description="an object with prostate_left and prostate_right, each a number from 0.5 to 2000"),
]
_Walls = Annotated[WallsFile, Meta(description="an object with 'rectum', 'bladder' or both")]


class SpecFile(_Part, frozen=True, kw_only=True):
    """The whole file; paths of `source` are relative to it."""

    name: _Line | None = None
    source: _Source = "phantom"
    stiffness_kpa: _Organ
    tissue_kpa: _Modulus = 20.0
    tissue_poisson_ratio: Annotated[float, Meta(ge=0.0, le=0.498)] = 0.49
    mu1_share: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.5
    walls: _Walls
    hidden: HiddenFile = HiddenFile()
    contour_noise_sd_mm: Annotated[float, Meta(ge=0.0, le=3.0)] = 0.0
    noise_correlation_mm: Annotated[float, Meta(ge=2.0, le=50.0)] = 8.0
    mesh: MeshFile = MeshFile()
    scan: ScanFile = ScanFile()
    output: Literal["dicom", "labels"] = "dicom"
    seed: Annotated[float, Meta(ge=0, le=2**31 - 1, multiple_of=1)] = 1
