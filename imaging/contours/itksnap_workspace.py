"""ITK-SNAP workspaces (.itksnap): which images belong together, and what the labels mean.

The file is XML: folders and entries with keys. Layers.Layer[n] has AbsolutePath and Role; the main layer keeps the label
table. Paths count relative to SaveLocation where the file has been moved together with its images.
"""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from palpate.core.errors import InputError
from palpate.imaging.labels import LABEL_COLOURS, LABELS

MAIN, LABEL_LAYER, OVERLAY = "MainRole", "SegmentationRole", "OverlayRole"
_LARGEST_BYTES = 16 * 2**20
_HEADER = """\
<?xml version="1.0" encoding="UTF-8" ?>
<!--ITK-SNAP (itksnap.org) Project File

Written by Palpate. Keep it in one folder with the images that it names.
-->
<!DOCTYPE registry [
<!ELEMENT registry (entry*,folder*)>
<!ELEMENT folder (entry*,folder*)>
<!ELEMENT entry EMPTY>
<!ATTLIST folder key CDATA #REQUIRED>
<!ATTLIST entry key CDATA #REQUIRED>
<!ATTLIST entry value CDATA #REQUIRED>
]>
"""
_VERSION = "20190612"


@dataclass(frozen=True)
class Layer:
    """One image of a workspace. colours : the preset of its colour map; range : what it spans; opacity : 0 to 1."""

    path: Path
    role: str
    nickname: str = ""
    colours: str = "Grayscale"
    opacity: float = 1.0


@dataclass(frozen=True)
class Workspace:
    """layers : as the file lists them. names : value -> name of its label table, empty where it has none."""

    layers: tuple[Layer, ...]
    names: dict[int, str]

    def only(self, role: str, source: str) -> Layer:
        """The one layer of a role. Raises InputError where there is none, are several, or its image is not there."""
        found = [layer for layer in self.layers if layer.role == role]
        if len(found) != 1:
            raise InputError(
                f"{source} has {len(found)} layers of {role}; one is needed: save a workspace with one segmentation"
            )
        if not found[0].path.is_file():
            raise InputError(
                f"{source} names {found[0].path}, which is not there; keep the workspace with its images, or save it again"
            )
        return found[0]


def read_workspace(path: Path) -> Workspace:
    """The layers and label names of a workspace. Raises InputError naming the file when it cannot be read."""
    try:
        if path.stat().st_size > _LARGEST_BYTES:
            raise InputError(f"{path} is too large for an ITK-SNAP workspace; save it again with ITK-SNAP")
        root = ET.fromstring(path.read_bytes())
    except FileNotFoundError as error:
        raise InputError(f"{path} is not there; give the path of an .itksnap file") from error
    except (ET.ParseError, OSError, ValueError, LookupError) as error:
        raise InputError(f"{path} is not a readable ITK-SNAP workspace; save it again with ITK-SNAP") from error
    saved = _entry(root, "SaveLocation")
    layers, names = [], {}
    for folder in _folders(_folder(root, "Layers"), "Layer["):
        text, role = _entry(folder, "AbsolutePath"), _entry(folder, "Role")
        if text and "\0" not in text:
            layers.append(Layer(_found(text, saved, path.parent), role))
        if role == MAIN:
            names = _label_names(folder)
    if not layers:
        raise InputError(f"{path} names no images; save the workspace again with ITK-SNAP")
    return Workspace(tuple(layers), names)


def workspace_text(layers: Sequence[Layer], folder: Path, size: Sequence[int]) -> str:
    """The text of a workspace in ``folder`` that opens the layers, the main one first, with the labels of a case.

    size : voxels of the main image along its axes, without which ITK-SNAP passes over the label table.
    """
    root = ET.Element("registry")
    _put(root, SaveLocation=str(folder.absolute()), Version=_VERSION)
    listed = _sub(root, "Layers")
    for number, layer in enumerate(layers):
        entry = _sub(listed, f"Layer[{number:03d}]")
        _put(entry, AbsolutePath=str(layer.path.absolute()), Role=layer.role, Tags="")
        shown = _sub(entry, "LayerMetaData")
        sticky = "1" if layer.role == OVERLAY else "0"
        _put(shown, Alpha=f"{layer.opacity:g}", CustomNickName=layer.nickname, Sticky=sticky, Tags="")
        if layer.role != LABEL_LAYER:
            _put(_sub(_sub(shown, "DisplayMapping"), "ColorMap"), Preset=layer.colours)
        if layer.role == OVERLAY:
            _put(_sub(entry, "ImageTransform"), IsIdentity="1")
        if layer.role == MAIN:
            _add_label_table(_sub(entry, "ProjectMetaData"), size)
    ET.indent(root)
    return _HEADER + ET.tostring(root, encoding="unicode") + "\n"


def _add_label_table(project: ET.Element, size: Sequence[int]) -> None:
    _put(_sub(_sub(project, "Files"), "Grey"), Dimensions=" ".join(str(n) for n in size))
    table = _sub(_sub(project, "IRIS"), "LabelTable")
    shown = [value for value in LABELS if value]
    _put(table, NumberOfElements=str(len(shown)))
    for number, value in enumerate(shown):
        red, green, blue, opacity = LABEL_COLOURS[value]
        _put(
            _sub(table, f"Element[{number}]"), Alpha=str(round(255 * opacity)), Color=f"{red} {green} {blue}", Flags="1 1",
            Index=str(value), Label=LABELS[value],
        )  # fmt: skip


def _found(text: str, saved: str, here: Path) -> Path:
    """Where a layer's image is now: beside the workspace as it was when saved, else where it was then."""
    plain, base = text.replace("\\", "/"), saved.replace("\\", "/")
    if base and PurePosixPath(plain).is_absolute() == PurePosixPath(base).is_absolute():
        moved = here / os.path.relpath(plain, base)
        if moved.is_file():
            return moved
    return Path(text)


def _label_names(main: ET.Element) -> dict[int, str]:
    table = main
    for key in ("ProjectMetaData", "IRIS", "LabelTable"):
        table = _folder(table, key)
    found = {}
    for element in _folders(table, "Element["):
        index = _entry(element, "Index")
        if index.isascii() and index.isdigit() and len(index) < 6:
            found[int(index)] = _entry(element, "Label")
    return found


def _sub(parent: ET.Element, key: str) -> ET.Element:
    return ET.SubElement(parent, "folder", key=key)


def _put(folder: ET.Element, **entries: str) -> None:
    for number, (key, value) in enumerate(entries.items()):
        folder.insert(number, ET.Element("entry", key=key, value=value))


def _entry(folder: ET.Element, key: str) -> str:
    return next((e.get("value", "") for e in folder.findall("entry") if e.get("key") == key), "")


def _folders(folder: ET.Element, start: str) -> list[ET.Element]:
    return [e for e in folder.findall("folder") if e.get("key", "").startswith(start)]


def _folder(folder: ET.Element, key: str) -> ET.Element:
    return next((e for e in folder.findall("folder") if e.get("key") == key), ET.Element("folder"))
