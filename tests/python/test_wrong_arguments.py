"""Every public function of `palpate` answers what is of a wrong type, shape or unit with InputError, and reaches no computation."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st

import palpate
from palpate.core.errors import InputError
from palpate.core.fem.meshes import sphere_in_cube
from palpate.core.surfaces.surface import Surface
from palpate.ui.python import from_arrays, from_scans, sphere

QUICK = settings(max_examples=150, deadline=None, database=None)
# Nothing that any argument can be.
NEVER = [
    object(),
    b"x",
    1j,
    {1, 2},
    datetime.date(2026, 1, 1),
    lambda: 1,
    [[1.0], [1.0, 2.0]],
    np.array(["a", "b"]),
    float("nan"),
    -1,
]
NO_NUMBER = [None, "20", [1.0], {}, True, float("inf"), 0, np.nan, np.ones(3)]
NO_ARRAYS = [
    pv.PolyData(),
    pv.UnstructuredGrid(),
    None,
    5,
    "mesh.vtu",
    (),
    (1, 2),
    (1, 2, 3),
    {},
    [[], [], []],
    np.ones((4, 3)),
    np.zeros(0),
]
NO_PATH = [5, None, "", "a\0b", [], {}, 1.5, ("a", "b")]
NO_CHOICE = [5, "none", [], {}, 1.5, "", np.ones(2)]
NO_TRUTH = [None, "yes", 2, 0.5, [], {}, np.ones(2)]
OPTIONS: dict[str, list[Any]] = {
    **{key: [*NO_CHOICE, None] for key in ("method", "boundary", "element", "law")},
    **{key: [None, "3", 2.5, 0, 10**9, [], True] for key in ("particles", "iterations", "starts", "workers")},
    "seed": [None, "3", 2.5, [], {}, True],
    **dict.fromkeys(("reduced", "stiffness_map", "split_mu", "uneven"), NO_TRUTH),
    "image": NO_TRUTH[1:],
    **{key: [None, 1, "text"] for key in ("particle", "Law", "tissue", "x")},  # no option has these names
}
ARRAYS: dict[str, list[Any]] = {
    **dict.fromkeys(("mesh", "deformed", "driven", "fixed"), NO_ARRAYS),
    "rest": [one for one in NO_ARRAYS if one is not None],
    **dict.fromkeys(("tissue_G", "noise_sd_mm", "noise_correlation_mm"), NO_NUMBER),
    "bounds_kpa": [None, 5.0, (5.0,), (500.0, 5.0), ("5", "500"), (0, 1), (1, np.inf), {}, "ab", np.ones((2, 2))],
}
SCANS: dict[str, list[Any]] = {
    **dict.fromkeys(("rest", "deformed", "case"), NO_PATH),
    **{key: [*NO_PATH[:1], *NO_PATH[2:]] for key in ("landmarks", "registration")},
    "labels": [None, 5, "a.dcm", (None,), (1, 2), ("a", 5), {}, ("", "a")],
    **dict.fromkeys(("diagnosis", "report"), NO_TRUTH),
    "progress": [None, 5, "told", []],
}
SPHERE: dict[str, list[Any]] = {"G": NO_NUMBER, "depth_mm": NO_NUMBER, "fineness": [None, "3", 2.5, 0, [], True]}


class Reached(Exception):
    """The computation began: what was wrong was taken."""


@pytest.fixture(scope="module")
def body() -> dict[str, Any]:
    """A ball in a cube that `identify` takes."""
    mesh = sphere_in_cube(1, 1, 2, 10.0, 15.0)
    faces, owner = mesh.region_boundary((1,))
    ball, y = Surface(mesh.points, faces, mesh.regions[owner]), mesh.points[:, 1]
    wall = sphere._wall(3.0)
    return {
        "mesh": (mesh.points, mesh.cells, mesh.regions), "rest": (ball.points, ball.faces),
        "deformed": (ball.points, ball.faces), "fixed": y < 1e-6 - 15.0, "driven": (y > 15.0 - 1e-6, (wall.points, wall.faces)),
    }  # fmt: skip


@pytest.fixture(autouse=True, scope="module")
def no_work() -> Any:
    def reached(*_: object, **__: object) -> None:
        raise Reached

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(from_arrays, "_answer", reached)
        patch.setattr(from_scans, "run_import", reached)
        patch.setattr(sphere, "plain_scene", reached)
        yield


def one_wrong(wrong: dict[str, list[Any]]) -> st.SearchStrategy[tuple[str, Any]]:
    return st.sampled_from(sorted(wrong)).flatmap(
        lambda name: st.tuples(st.just(name), st.sampled_from([*wrong[name], *(v for v in NEVER if not fits(name, v))]))
    )


def fits(name: str, value: object) -> bool:
    """Of `NEVER`, what an argument can be after all: a seed is any whole number, a function hears of progress."""
    return (name == "seed" and isinstance(value, int)) or (name == "progress" and callable(value))


def refused(call: Any, arguments: dict[str, Any]) -> None:
    with pytest.raises(InputError) as error:
        call(**arguments)
    assert "\n" not in str(error.value) and len(str(error.value)) < 400


@pytest.mark.parametrize("call", [palpate.identify, palpate.diagnose])
@QUICK
@given(one_wrong({**ARRAYS, **OPTIONS}))
def test_of_arrays(body: dict[str, Any], call: Any, change: tuple[str, Any]) -> None:
    refused(call, {**body, change[0]: change[1]})


def test_what_is_right_is_taken(body: dict[str, Any], tmp_path: Path) -> None:
    for call, given_ in ((palpate.identify, body), (palpate.diagnose, body), (palpate.example_sphere, {})):
        with pytest.raises(Reached):
            call(**given_)
    with pytest.raises(Reached):
        palpate.analyze(tmp_path, tmp_path, tmp_path, labels=["a", None], seed=np.int64(3))  # type: ignore[arg-type]


@QUICK
@given(
    st.sampled_from(["mesh", "rest", "deformed", "driven"]),
    st.sampled_from(["points", "cells"]),
    st.sampled_from(
        [1e-6, 1e-3, 1e3, 1e6, 1e30, np.nan, "int", "text", "flat", "short", "wide", "empty", "over", "below"]
    ),
)
def test_of_shapes_and_units(body: dict[str, Any], name: str, part: str, how: Any) -> None:
    given_ = body[name][1] if name == "driven" else body[name]
    at = 0 if part == "points" else 1
    array = np.array(given_[at], dtype=np.float64)
    match how:
        case float():
            changed: Any = array * how if part == "points" or np.isnan(how) or how > 1.0 else array + how
        case "int":
            changed = array + 0.5 if part == "cells" else array.astype(str)
        case "text":
            changed = array.astype(str).tolist()
        case "flat":
            changed = array.ravel()
        case "short":
            changed = array[:, :2]
        case "wide":
            changed = np.hstack([array, array])
        case "empty":
            changed = array[:0]
        case "over":
            changed = array + 1e9
        case "below":
            changed = -array if part == "cells" else array[:3]
    parts = [changed if k == at else one for k, one in enumerate(given_)]
    refused(palpate.identify, {**body, name: (body[name][0], tuple(parts)) if name == "driven" else tuple(parts)})


@QUICK
@given(one_wrong({**SCANS, **OPTIONS}))
def test_of_scans(change: tuple[str, Any]) -> None:
    refused(palpate.analyze, {"rest": "a", "deformed": "b", "case": "c", change[0]: change[1]})


@QUICK
@given(one_wrong(SPHERE))
def test_of_the_sphere(change: tuple[str, Any]) -> None:
    refused(palpate.example_sphere, dict([change]))


@QUICK
@given(st.sampled_from([*NO_PATH, *NEVER]))
def test_of_a_case(value: Any) -> None:
    refused(palpate.load, {"case": value})
