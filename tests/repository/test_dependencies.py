"""Every package that the code imports is declared in pyproject.toml; what is optional is imported late and by few files."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from rooms import PACKAGES

TOP = Path(__file__).parents[2]
PROJECT = tomllib.loads((TOP / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# Distributions whose import name is another.
IMPORT_NAMES = {
    "import-linter": ("importlinter",),
    "opencv-python-headless": ("cv2",),
    "pillow": ("PIL",),
    "pyside6-essentials": ("PySide6", "shiboken6"),
    "pytest-xdist": ("xdist",),
    "python-gdcm": ("gdcm",),
    "pylibjpeg-openjpeg": ("openjpeg",),
    "scikit-fem": ("skfem",),
    "scikit-image": ("skimage",),
    "slicer-core": ("slicer",),
    "vtk": ("vtk", "vtkmodules"),
}
# What a user installs on top (learned segmenters, programs to compare with, a cluster), and the folder that may import it.
OPTIONAL = {
    "totalsegmentator": "segmentation/models",
    "monai": "segmentation/models",
    "torch": "segmentation/models",
    "felupe": "validate/bench/peers",
    "dolfinx": "validate/bench/peers",
    "mpi4py": "validate/bench/peers",
    "petsc4py": "validate/bench/peers",
    "ufl": "validate/bench/peers",
    "distributed": "core/worker",
}
# A peer runs as a script of its own, in the environment of the program that it compares with, beside this file.
SCRIPTS = {"validate/bench/peers": {"protocol", "felupe_peer"}}


def import_names(requirements: list[str]) -> set[str]:
    """Top-level import names of requirements such as "numpy>=2.0; marker"."""
    names = [re.split(r"[\s<>=!~;\[]", one, maxsplit=1)[0].lower() for one in requirements]
    return {name for one in names for name in IMPORT_NAMES.get(one, (one,))}


def imported(source: str) -> Iterator[tuple[str, bool]]:
    """Top-level names of the packages that a module imports from elsewhere, and whether at its top, where no call can be spared it."""
    tree = ast.parse(source)
    late = {
        id(node) for outer in ast.walk(tree) if isinstance(outer, (ast.FunctionDef, ast.If)) for node in ast.walk(outer)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names = [node.module or ""]
        elif _is_import_call(node):
            names = [node.args[0].value]  # type: ignore[attr-defined]
        else:
            continue
        for name in names:
            package = name.split(".")[0]
            if package not in sys.stdlib_module_names and package != "palpate":
                yield package, id(node) not in late


def _is_import_call(node: ast.AST) -> bool:
    """Whether the node is `import_module("...")` or `__import__("...")` of a stated name."""
    if not (isinstance(node, ast.Call) and node.args):
        return False
    called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    stated = isinstance(node.args[0], ast.Constant) and isinstance(node.args[0].value, str)
    return called in ("import_module", "__import__") and stated


def undeclared(path: str, source: str, declared: set[str]) -> list[str]:
    """What is wrong with the imports of one file, a line each."""
    folder = str(Path(path).parent)
    wrong = []
    for package, at_top in imported(source):
        if package in declared or package.lower() in declared or package in SCRIPTS.get(folder, set()):
            continue
        if OPTIONAL.get(package) == folder and (not at_top or folder in SCRIPTS):
            continue
        wrong.append(f"{path} imports {package}, which pyproject.toml does not declare")
    return wrong


def test_the_rooms_import_only_what_is_declared() -> None:
    always, extra = PROJECT["dependencies"], PROJECT["optional-dependencies"]["applications"]
    files = [(room, path) for room in PACKAGES for path in sorted((TOP / room).rglob("*.py"))]
    wrong = [
        line
        for room, path in files
        for line in undeclared(
            str(path.relative_to(TOP)),
            path.read_text(encoding="utf-8"),
            import_names([*always, *(extra if room == "applications" else [])]),
        )
    ]
    assert len(files) > 500 and wrong == []


def test_the_tests_import_only_what_is_declared_for_development() -> None:
    extras = PROJECT["optional-dependencies"]
    declared = import_names([*PROJECT["dependencies"], *extras["applications"], *extras["dev"]])
    files = sorted((TOP / "tests").rglob("*.py"))
    own = {path.stem for path in [*files, *(TOP / "validate/bench/peers").glob("*.py")]} | {"PalpateStiffnessLib"}
    wrong = [
        line
        for path in files
        for line in undeclared(str(path.relative_to(TOP)), path.read_text(encoding="utf-8"), declared | own)
    ]
    assert len(files) > 100 and wrong == []


def test_the_scripts_of_the_pages_import_only_what_is_declared_for_them() -> None:
    extras = PROJECT["optional-dependencies"]
    # The film of a fall, of which a page shows a picture, needs the extra of the room that makes it.
    declared = import_names([*PROJECT["dependencies"], *extras["dev"], *extras["docs"], *extras["applications"]])
    files = sorted((TOP / "docs").glob("*.py"))
    wrong = [
        line
        for path in files
        for line in undeclared(
            str(path.relative_to(TOP)), path.read_text(encoding="utf-8"), declared | {p.stem for p in files}
        )
    ]
    assert len(files) > 5 and wrong == []


@pytest.mark.parametrize(
    ("path", "source", "wrong"),
    [
        ("core/mesh.py", "import numpy as np\nfrom scipy import sparse\nimport json", 0),
        ("core/mesh.py", "import requests", 1),
        ("core/mesh.py", "def f():\n    from requests.sessions import Session", 1),
        ("core/mesh.py", "import importlib\nimportlib.import_module('requests')", 1),
        ("ui/pictures/planes.py", "from PIL import Image", 0),
        ("ui/pictures/planes.py", "def f():\n    import cv2", 1),
        ("core/mesh.py", "def f():\n    import torch", 1),
        ("segmentation/models/learned.py", "def f():\n    import torch", 0),
        ("segmentation/models/learned.py", "import torch", 1),
    ],
)
def test_an_undeclared_import_is_seen(path: str, source: str, wrong: int) -> None:
    assert len(undeclared(path, source, import_names(PROJECT["dependencies"]))) == wrong


def test_without_its_declaration_an_import_of_the_code_is_refused() -> None:
    declared = import_names(PROJECT["dependencies"]) - {"PIL"}
    lines = [
        line
        for path in sorted((TOP / "ui").rglob("*.py"))
        for line in undeclared(str(path.relative_to(TOP)), path.read_text(encoding="utf-8"), declared)
    ]
    assert lines and all(line.endswith("imports PIL, which pyproject.toml does not declare") for line in lines)
