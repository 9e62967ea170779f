"""What a bench child speaks: it reads the scene file named on its command line, then one JSON request a line, and answers each.

A scene file is an npz with nodes (n, 3) mm, cells (m, 4 or 10; mid-edge nodes in the order 01 12 02 03 13 23), regions (m,),
G and K (m,) kPa of a neo-Hookean solid psi = G/2 (I1bar - 3) + K/2 (J - 1)^2, fixed (n, 3) bool, prescribed (n, 3) mm,
force (n, 3) mN, corners : number of nodes that are vertices, mixed : whether pressure is an unknown of its own. Where moduli are to be
found: unknown (t,) regions, observed (k,) nodes, measured (k, 3) mm their displacements; the answer is then ln G (t,) in place of
displacements, and the number of equilibria in place of iterations.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from typing import NotRequired, TypedDict

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


class Arrays(TypedDict):
    """The scene file; `corners`, `mixed` and `element` are arrays without an axis."""

    nodes: FloatArray
    cells: IntArray
    regions: IntArray
    G: FloatArray
    K: FloatArray
    fixed: BoolArray
    prescribed: FloatArray
    force: FloatArray
    corners: IntArray
    mixed: BoolArray
    element: NDArray[np.str_]
    unknown: NotRequired[IntArray]
    observed: NotRequired[IntArray]
    measured: NotRequired[FloatArray]


class Request(TypedDict):
    """One solve: load steps, relative residual, and the file for its displacements, if they are wanted."""

    steps: int
    rtol: float
    out: str | None


class Cost(TypedDict):
    """What one solve took; memory is that of the process so far."""

    seconds: float
    cpu_seconds: float
    memory_mb: float | None


class Timed:
    """Returned in place of iterations by a solver that runs a program of its own: seconds without what every run repeats."""

    def __init__(self, iterations: int, seconds: float, cpu_seconds: float) -> None:
        self.iterations, self.seconds, self.cpu_seconds = iterations, seconds, cpu_seconds


# (steps, rtol) -> displacements (n, 3) mm and iterations. Load in so many equal steps; raises ArithmeticError or ValueError.
Solver = Callable[[int, float], tuple[FloatArray, int | Timed]]


def serve(load: Callable[[Arrays], Solver], version: str) -> None:
    """Answer requests {"steps", "rtol", "out"} until standard input ends. What libraries print goes to standard error."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    start = time.perf_counter()
    with np.load(sys.argv[1], allow_pickle=False) as data:
        arrays: Arrays = {
            "nodes": data["nodes"],
            "cells": data["cells"],
            "regions": data["regions"],
            "G": data["G"],
            "K": data["K"],
            "fixed": data["fixed"],
            "prescribed": data["prescribed"],
            "force": data["force"],
            "corners": data["corners"],
            "mixed": data["mixed"],
            "element": data["element"],
        }
        if "unknown" in data:
            arrays |= {"unknown": data["unknown"], "observed": data["observed"], "measured": data["measured"]}
    solve = load(arrays)
    print(json.dumps({"setup_seconds": time.perf_counter() - start, "version": version}), file=answers)
    for line in sys.stdin:
        print(json.dumps(_answer(solve, json.loads(line))), file=answers)


def _answer(solve: Solver, request: Request) -> dict[str, object]:
    start, cpu = time.perf_counter(), time.process_time()
    try:
        with np.errstate(all="ignore"):
            u, iterations = solve(request["steps"], request["rtol"])
    except (ArithmeticError, ValueError, RuntimeError, np.linalg.LinAlgError) as error:
        lines = str(error).strip().splitlines() or [type(error).__name__]
        return {"reason": lines[0][:200], "seconds": time.perf_counter() - start, "memory_mb": memory_mb()}
    cost: Cost = {
        "seconds": time.perf_counter() - start,
        "cpu_seconds": time.process_time() - cpu,
        "memory_mb": memory_mb(),
    }
    if isinstance(iterations, Timed):
        cost = {"seconds": iterations.seconds, "cpu_seconds": iterations.cpu_seconds, "memory_mb": None}
        iterations = iterations.iterations
    if not np.isfinite(u).all():
        return {"reason": "the solution is not finite", **cost}
    if request["out"]:
        np.save(request["out"], np.asarray(u))
    return {"reason": "", "iterations": int(iterations), **cost}


def memory_mb() -> float | None:
    """Largest resident memory of this process so far. Not `getrusage`: that counts what the parent held when it forked."""
    try:
        with open("/proc/self/status") as status:
            return next(float(line.split()[1]) / 1024.0 for line in status if line.startswith("VmHWM"))
    except OSError:
        return None
