"""Draws docs/architecture.svg: the rooms, and which room imports which, read from the source files.

    .venv/bin/python docs/draw_architecture.py

A row shows what a room imports, a column shows who imports it; the number is how many modules do. Rooms stand in import
order, so that every arrow points down. An import that runs up would be drawn in red. `tests/repository/test_architecture.py`
fails when the picture no longer shows the imports that there are.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

TOP = Path(__file__).resolve().parents[1]
PICTURE = TOP / "docs" / "architecture.svg"

# Top to bottom; rooms of one row of the import contract (pyproject.toml) share a band.
LAYERS = (
    ("applications",),
    ("ui",),
    ("validate",),
    ("case",),
    ("simulate",),
    ("segmentation", "meshing"),
    ("imaging",),
    ("core",),
)
WORDS = {
    "applications": ("touch, fall, drawn", "figures that move"),
    "ui": ("command line, window,", "report, exports"),
    "validate": ("studies of the paper", "and of our own"),
    "case": ("one patient's folder", "and its steps"),
    "simulate": ("pairs whose stiffness", "is known"),
    "segmentation": ("CT to labels", ""),
    "meshing": ("labels to surfaces", "and tetrahedra"),
    "imaging": ("scans, contours,", "surfaces, registration"),
    "core": ("mechanics and inference", "on arrays"),
}
ROOMS = tuple(room for layer in LAYERS for room in layer)

WIDTH, HEIGHT, STEP_X, STEP_Y, EDGE = 216, 62, 130, 84, 20
FONT = "font-family='Helvetica, Arial, sans-serif'"


def modules(room: str) -> list[Path]:
    """The Python files of a room."""
    return sorted((TOP / room).rglob("*.py"))


def imports() -> Counter[tuple[str, str]]:
    """(importing room, imported room) -> how many modules of the first import something of the second."""
    found: Counter[tuple[str, str]] = Counter()
    for room in ROOMS:
        for path in modules(room):
            others = set(_rooms_named(ast.parse(path.read_text(encoding="utf-8")))) - {room}
            found.update((room, other) for other in others)
    return found


def drawn(svg: str) -> dict[tuple[str, str], int]:
    """The imports that a picture made by this script shows, with their numbers."""
    marks = [part.split("'", 6) for part in svg.split("<g data-from=")[1:]]
    return {(mark[1], mark[3]): int(mark[5]) for mark in marks}


def runs_down(a: str, b: str) -> bool:
    """Whether room `b` stands below room `a`."""
    return ROOMS.index(a) < ROOMS.index(b)


def picture(found: Mapping[tuple[str, str], int], sizes: Mapping[str, int]) -> str:
    """The SVG. found : as of `imports`. sizes : modules of each room."""
    width, height = EDGE * 2 + STEP_X * (len(ROOMS) - 1) + WIDTH, EDGE * 2 + STEP_Y * (len(ROOMS) - 1) + HEIGHT
    head = f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width} {height}' width='{width}' height='{height}'>"
    arrow = (
        "<defs><marker id='tip' viewBox='0 0 10 10' refX='9' refY='5' markerWidth='7' markerHeight='7' orient='auto'>"
        "<path d='M0 0L10 5L0 10z' fill='#5b6b7b'/></marker></defs>"
    )
    background = f"<rect width='{width}' height='{height}' fill='white'/>"
    parts = [head, arrow, background, *_bands(width), *_buses(found), *_boxes(sizes), *_nodes(found), "</svg>"]
    return "\n".join(parts) + "\n"


def _rooms_named(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        for name in names:
            parts = name.split(".")
            if parts[0] == "palpate" and len(parts) > 1 and parts[1] in ROOMS:
                yield parts[1]


def _corner(room: str) -> tuple[int, int]:
    index = ROOMS.index(room)
    return EDGE + index * STEP_X, EDGE + index * STEP_Y


def _bands(width: int) -> Iterator[str]:
    """A grey strip behind every second layer, so that the eye stays in its row."""
    for number, layer in enumerate(LAYERS):
        top = _corner(layer[0])[1] - (STEP_Y - HEIGHT) // 2
        if number % 2 == 0:
            yield f"<rect x='0' y='{top}' width='{width}' height='{STEP_Y * len(layer)}' fill='#f3f5f7'/>"


def _buses(found: Mapping[tuple[str, str], int]) -> Iterator[str]:
    """The lines: out of a room to the right (or left, for an import that runs up), then into the other from above (below)."""
    line = "<path d='{}' fill='none' stroke='#9aa7b4' stroke-width='1.6'{}/>"
    for room in ROOMS:
        x, y = _corner(room)
        across = [_node(room, other)[0] for a, other in found if a == room and runs_down(room, other)]
        if across:
            yield line.format(f"M{x + WIDTH} {y + HEIGHT // 2}H{max(across)}", "")
        above = [_node(other, room)[1] for other, b in found if b == room and runs_down(other, room)]
        if above:
            yield line.format(f"M{x + WIDTH // 2} {min(above)}V{y}", " marker-end='url(#tip)'")
    for a, b in found:
        if not runs_down(a, b):
            (x, y), (x2, y2) = _corner(a), _corner(b)
            path = f"M{x} {y + HEIGHT // 2}H{x2 + WIDTH // 2}V{y2 + HEIGHT}"
            yield f"<path d='{path}' fill='none' stroke='#c0392b' stroke-width='1.6'/>"


def _boxes(sizes: Mapping[str, int]) -> Iterator[str]:
    for room in ROOMS:
        x, y = _corner(room)
        first, second = WORDS[room]
        yield f"<rect x='{x}' y='{y}' width='{WIDTH}' height='{HEIGHT}' rx='6' fill='#e4eef8' stroke='#34495e'/>"
        yield f"<text x='{x + 10}' y='{y + 21}' {FONT} font-size='15' font-weight='bold' fill='#1c2833'>{room}/</text>"
        yield (
            f"<text x='{x + WIDTH - 8}' y='{y + 20}' {FONT} font-size='11' fill='#5b6b7b' text-anchor='end'>"
            f"{sizes[room]} modules</text>"
        )
        for words, below in ((first, 39), (second, 54)):
            yield f"<text x='{x + 10}' y='{y + below}' {FONT} font-size='12' fill='#1c2833'>{words}</text>"


def _nodes(found: Mapping[tuple[str, str], int]) -> Iterator[str]:
    for (a, b), number in sorted(found.items()):
        x, y = _node(a, b)
        colour = "#34495e" if runs_down(a, b) else "#c0392b"
        yield (
            f"<g data-from='{a}' data-to='{b}' data-count='{number}'><title>{number} modules of {a} import {b}</title>"
            f"<circle cx='{x}' cy='{y}' r='13' fill='white' stroke='{colour}' stroke-width='1.6'/>"
            f"<text x='{x}' y='{y + 4}' {FONT} font-size='12' fill='{colour}' text-anchor='middle'>{number}</text></g>"
        )


def _node(a: str, b: str) -> tuple[int, int]:
    """Where the row of `a` meets the column of `b`."""
    return _corner(b)[0] + WIDTH // 2, _corner(a)[1] + HEIGHT // 2


if __name__ == "__main__":
    PICTURE.write_text(picture(imports(), {room: len(modules(room)) for room in ROOMS}), encoding="utf-8")
