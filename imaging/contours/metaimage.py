"""MetaImage files (.mha, .mhd): read here, because ITK's reader crashes on headers that are damaged and passes over keys."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray, NumberArray
from palpate.core.errors import InputError
from palpate.imaging.contours.nifti_labels import MOST_VOXELS

METAIMAGE = (".mha", ".mhd")
_LONGEST_HEADER = 2**16
_LONGEST_NAME = 60
# The types of voxels, as numpy calls them; a long has four bytes here.
_TYPES = {
    "MET_CHAR": "i1", "MET_UCHAR": "u1", "MET_SHORT": "i2", "MET_USHORT": "u2", "MET_INT": "i4", "MET_UINT": "u4", "MET_LONG": "i4",
    "MET_ULONG": "u4", "MET_LONG_LONG": "i8", "MET_ULONG_LONG": "u8", "MET_FLOAT": "f4", "MET_DOUBLE": "f8",
}  # fmt: skip
# By the names that writers use.
_ORIENTATION, _POSITION = ("transformmatrix", "rotation", "orientation"), ("offset", "position", "origin")
_MSB = ("binarydatabyteordermsb", "elementbyteordermsb")


@dataclass(frozen=True, eq=False)
class MetaImage:
    """array : voxels, (i, j, k). affine : (4, 4), index to LPS, mm. modality : what the file says that it shows, "" where it does not."""

    array: NumberArray
    affine: FloatArray
    modality: str


@dataclass(frozen=True, eq=False)
class _Header:
    """fields : by their keys in lower case. end : byte after it."""

    path: Path
    fields: Mapping[str, str]
    end: int

    def numbers(self, keys: tuple[str, ...], count: int) -> FloatArray:
        """The finite numbers under the one key that is there. Raises InputError."""
        for key in keys:
            if key in self.fields:
                try:
                    found = np.array([float(word) for word in self.fields[key].split()])
                except ValueError:
                    break
                if found.shape != (count,) or not np.isfinite(found).all():
                    break
                return found
        raise InputError(f"{self.path} does not say its {keys[0]} in {count} numbers; save it again")

    def is_true(self, *keys: str) -> bool:
        """Whether one of the keys says so. Raises InputError where it says neither."""
        said = next((self.fields[key].lower() for key in keys if key in self.fields), "false")
        if said not in ("true", "false", "1", "0"):
            raise InputError(
                f"{self.path} is not a readable MetaImage file: {keys[0]} is neither true nor false; save it again"
            )
        return said in ("true", "1")


def read_metaimage(path: Path) -> MetaImage:
    """The voxels of a MetaImage, within the file or in the one beside it that it names.

    Raises InputError naming the file when it is not readable, damaged, no volume of one number a voxel, sheared, or without a place
    in the patient.
    """
    if not path.is_file():
        raise InputError(f"{path} is not there; correct its path")
    header = _header(path)
    shape = _shape(header)
    if not any(key in header.fields for key in _ORIENTATION) or not any(key in header.fields for key in _POSITION):
        raise InputError(f"{path} does not say where it lies in the patient (TransformMatrix, Offset); save it again")
    affine = _affine(header)
    kind = np.dtype(_TYPES[header.fields["elementtype"].upper()]).newbyteorder(">" if header.is_true(*_MSB) else "<")
    content = _voxels(header, int(np.prod(shape)) * kind.itemsize)
    array = np.frombuffer(content, dtype=kind).reshape(shape, order="F")
    return MetaImage(array.astype(kind.newbyteorder("=")), affine, header.fields.get("modality", ""))


def voxel_files(path: Path) -> list[Path]:
    """The file, and the one beside it that holds its voxels, where a MetaImage (.mhd) names one. Raises InputError."""
    if not path.name.lower().endswith(METAIMAGE) or not path.is_file():
        return [path]
    header = _header(path)
    return [path] if _is_local(header) else [path, _beside(header)]


def _header(path: Path) -> _Header:
    """Raises InputError where it does not end with the place of the voxels, or says one thing twice."""
    fields: dict[str, str] = {}
    with path.open("rb") as stream:
        while stream.tell() < _LONGEST_HEADER:
            key, sign, value = stream.readline(_LONGEST_HEADER).decode("utf-8", "replace").partition("=")
            name = key.strip().lower()
            if not sign or name in fields:
                break
            fields[name] = value.strip()
            if name == "elementdatafile":
                _check(path, fields)
                return _Header(path, fields, stream.tell())
    raise InputError(f"{path} is not a readable MetaImage file; save it again")


def _check(path: Path, fields: Mapping[str, str]) -> None:
    """Raises InputError where it is no image of numbers."""
    if fields.get("objecttype", "Image").lower() != "image" or fields.get("binarydata", "True").lower() == "false":
        raise InputError(f"{path} is not a readable MetaImage file: it is no image in binary numbers; save it again")
    if fields.get("elementtype", "").upper() not in _TYPES:
        raise InputError(f"{path} is not a readable MetaImage file: its ElementType is not known; save it again")
    if fields.get("elementnumberofchannels", "1") != "1":
        raise InputError(f"{path} holds more than a number for each voxel; save it with one")


def _shape(header: _Header) -> tuple[int, int, int]:
    path, words = header.path, header.fields.get("dimsize", "").split()
    if header.fields.get("ndims") != "3" or len(words) != 3:
        raise InputError(f"{path} is not a readable MetaImage file: one 3D volume is needed; save it again")
    if not all(word.isascii() and word.isdigit() and 0 < len(word) < 10 and int(word) > 0 for word in words):
        raise InputError(f"{path} is not a readable MetaImage file: its DimSize is no three counts; save it again")
    shape = int(words[0]), int(words[1]), int(words[2])
    if shape[0] * shape[1] * shape[2] > MOST_VOXELS:
        raise InputError(f"{path} has {shape} voxels, which is too many; crop it")
    return shape


def _affine(header: _Header) -> FloatArray:
    """A row of the file's matrix is the direction of an axis."""
    affine = np.eye(4)
    spacing = header.numbers(("elementspacing", "elementsize"), 3)
    direction = header.numbers(_ORIENTATION, 9).reshape(3, 3).T
    affine[:3, :3], affine[:3, 3] = direction * spacing, header.numbers(_POSITION, 3)
    if spacing.min() < 1e-3 or np.abs(direction.T @ direction - np.eye(3)).max() > 1e-3:
        raise InputError(f"{header.path} has a sheared or degenerate grid; resample it onto a right-angled one")
    return affine


def _voxels(header: _Header, needed: int) -> bytes:
    """The bytes of all voxels. Raises InputError naming the file that is damaged or too short."""
    inside = _is_local(header)
    file = header.path if inside else _beside(header)
    packed = header.is_true("compresseddata")
    before = header.end if inside else 0
    skipped = header.fields.get("headersize", "0")
    if skipped != "0" and not packed:
        before = max(before, file.stat().st_size - needed) if skipped == "-1" else before + _bytes_before(header)
    with file.open("rb") as stream:
        stream.seek(before)
        content = _unpacked(stream.read(), needed, file) if packed else stream.read(needed)
    if len(content) < needed:
        raise InputError(f"{file} ends before its voxels do; copy it again")
    return content


def _bytes_before(header: _Header) -> int:
    (skipped,) = header.numbers(("headersize",), 1)
    if not 0 <= skipped < 2**31:
        raise InputError(f"{header.path} is not a readable MetaImage file: its HeaderSize is no count; save it again")
    return int(skipped)


def _unpacked(packed: bytes, needed: int, file: Path) -> bytes:
    """As many bytes as are needed; its checksum is behind the last."""
    stream = zlib.decompressobj(47)  # zlib's header or that of gzip
    try:
        content = stream.decompress(packed, needed + 1)
    except zlib.error as error:
        raise InputError(f"{file} is damaged (its checksum or length is wrong); copy or save it again") from error
    if len(content) > needed:
        raise InputError(f"{file} is damaged (it holds more voxels than it says); copy or save it again")
    if not stream.eof:
        raise InputError(f"{file} ends before its voxels do; copy it again")
    return content


def _is_local(header: _Header) -> bool:
    return header.fields["elementdatafile"].upper() == "LOCAL"


def _beside(header: _Header) -> Path:
    path, name = header.path, header.fields["elementdatafile"]
    file = path.with_name(Path(name).name or path.name) if "\0" not in name and len(name) < _LONGEST_NAME else path
    if Path(name).name != name or "\\" in name or not file.is_file() or file == path:
        raise InputError(f"{path} names no file beside it that holds its voxels; save it as one .mha file")
    return file
