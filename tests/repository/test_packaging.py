"""A wheel holds what an editable install finds by itself."""

import tomllib
from pathlib import Path

TOP = Path(__file__).parents[2]


def package_of(folder: Path) -> str:
    """The import name of a folder: the package's own face, or a room that lies beside it."""
    parts = folder.relative_to(TOP).parts
    return ".".join(parts if parts[0] == "palpate" else ("palpate", *parts))


def test_every_package_is_listed() -> None:
    listed = tomllib.loads((TOP / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    there = [
        package_of(init.parent)
        for room in ("palpate", "core", "imaging", "segmentation", "meshing", "simulate", "case", "validate", "ui")
        for init in (TOP / room).rglob("__init__.py")
    ]
    assert sorted(listed) == sorted(there)


def test_files_that_are_no_python_go_with_their_package() -> None:
    data = tomllib.loads((TOP / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    for room in ("palpate", "core", "imaging", "segmentation", "meshing", "simulate", "case", "validate", "ui"):
        for path in (TOP / room).rglob("*.*"):
            if path.suffix == ".py" or "__pycache__" in path.parts:
                continue
            package = package_of(path.parent)
            assert any(path.match(pattern) for pattern in data.get(package, [])), path
