"""Sizes of folders, files and functions, and types of signatures, stay within what a newcomer can read."""

from __future__ import annotations

import ast
import statistics
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from rooms import PACKAGES

TOP = Path(__file__).parents[2]
FOLDERS = (*PACKAGES, "plugin")
Function = ast.FunctionDef | ast.AsyncFunctionDef

MOST_MODULES_A_FOLDER = 25
FILE_MEDIAN_LINES = 150
FUNCTION_P90_LINES = 35
LEAST_TYPED = 0.98
MOST_UNTYPED_VALUES = 60


def modules() -> list[Path]:
    """Python files of the rooms; a package's own face counts where it says something."""
    found = [path for room in FOLDERS for path in sorted((TOP / room).rglob("*.py")) if "__pycache__" not in path.parts]
    return [path for path in found if path.name != "__init__.py" or path.stat().st_size > 0]


def functions() -> Iterator[tuple[Path, Function]]:
    """Every function and method, nested ones too."""
    for path in modules():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, Function):
                yield path, node


def lines(node: Function) -> int:
    """Of a function with its signature and docstring."""
    return (node.end_lineno or node.lineno) - node.lineno + 1


def is_typed(node: Function) -> bool:
    """Whether the result and every argument but self and cls has a type."""
    a = node.args
    given = [*a.posonlyargs, *a.args, *a.kwonlyargs, *(x for x in (a.vararg, a.kwarg) if x is not None)]
    return node.returns is not None and all(x.annotation is not None or x.arg in ("self", "cls") for x in given)


def test_no_folder_holds_more_modules_than_one_can_look_over() -> None:
    count = Counter(path.parent.relative_to(TOP) for path in modules() if path.name != "__init__.py")
    over = {str(folder): n for folder, n in count.items() if n > MOST_MODULES_A_FOLDER}
    assert len(count) > 50 and over == {}, f"most modules a folder: {count.most_common(5)}"


def test_half_of_the_files_are_short() -> None:
    length = {path.relative_to(TOP): len(path.read_text(encoding="utf-8").splitlines()) for path in modules()}
    median = statistics.median(length.values())
    longest = sorted(length.items(), key=lambda one: -one[1])[:5]
    assert median <= FILE_MEDIAN_LINES, f"median {median:g} lines, longest {longest}"


def test_nine_functions_of_ten_fit_on_a_screen() -> None:
    length = sorted((lines(node), str(path.relative_to(TOP)), node.name) for path, node in functions())
    p90 = length[int(0.9 * len(length))][0]
    assert p90 <= FUNCTION_P90_LINES, f"p90 {p90} lines, longest {length[-5:]}"


def test_public_signatures_have_types() -> None:
    public = [(path, node) for path, node in functions() if not node.name.startswith("_")]
    bare = [f"{path.relative_to(TOP)}:{node.lineno} {node.name}" for path, node in public if not is_typed(node)]
    share = 1.0 - len(bare) / len(public)
    assert share >= LEAST_TYPED, f"{share:.2%} of {len(public)} public signatures are typed; without: {bare[:20]}"


def test_any_stands_at_the_edges_only() -> None:
    """Edges are libraries without types, processes and files whose form is not known yet."""
    found = Counter(
        str(path.relative_to(TOP))
        for path in modules()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Name) and node.id == "Any"
    )
    assert 0 < found.total() <= MOST_UNTYPED_VALUES, f"Any stands {found.total()} times: {found.most_common(8)}"


def test_a_signature_without_a_type_is_seen() -> None:
    source = "def f(self, x: int, *more: int) -> int: ...\ndef g(x) -> int: ...\ndef h(x: int): ...\ndef k(*, y=1) -> int: ..."
    assert [is_typed(node) for node in ast.parse(source).body if isinstance(node, Function)] == [
        True,
        False,
        False,
        False,
    ]
