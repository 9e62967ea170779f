"""What the code needs in many places is written once."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from rooms import PACKAGES

TOP = Path(__file__).parents[2]


def calls(name: str) -> Iterator[str]:
    """Files of the rooms that call `name`, such as "os.replace", as an attribute of that module."""
    module, function = name.split(".")
    for room in PACKAGES:
        for path in sorted((TOP / room).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if (
                    isinstance(node, ast.Attribute)
                    and node.attr == function
                    and isinstance(node.value, ast.Name)
                    and node.value.id == module
                ):
                    yield str(path.relative_to(TOP))


def test_one_module_puts_a_finished_file_in_the_place_of_another() -> None:
    assert set(calls("os.replace")) | set(calls("os.rename")) == {"core/files/atomic.py"}


def test_one_class_is_called_surface() -> None:
    named = [
        str(path.relative_to(TOP))
        for room in PACKAGES
        for path in sorted((TOP / room).rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef) and node.name in ("Surface", "TriSurface")
    ]
    assert named == ["core/surfaces/surface.py"]


def test_one_module_defines_the_types_of_arrays() -> None:
    named = [
        str(path.relative_to(TOP))
        for room in PACKAGES
        for path in sorted((TOP / room).rglob("*.py"))
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.Assign)
        and any(getattr(t, "id", "") in ("FloatArray", "IntArray") for t in node.targets)
    ]
    # What compares with other programs runs in their environments, where palpate is not installed.
    assert [name for name in named if name != "validate/bench/peers/protocol.py"] == ["core/arrays.py"] * 2


def test_no_two_test_files_have_one_name() -> None:
    """pytest imports them by their name alone: of two of one name, one is not collected."""
    names = Counter(path.name for path in (TOP / "tests").rglob("test_*.py"))
    assert [name for name, count in names.items() if count > 1] == []
