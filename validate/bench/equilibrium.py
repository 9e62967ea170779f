"""Seconds per equilibrium, all contenders in turn on the same scene, with how far their solutions agree."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import TypedDict

import numpy as np

from palpate.core.errors import InputError
from palpate.validate.bench.contender import Answer, Contender, ContenderSpec, solve_with_fewest_steps
from palpate.validate.bench.environment import ours
from palpate.validate.bench.options import BenchOptions
from palpate.validate.bench.scene_file import BenchScene, write_scene

LOAD_STEPS = (1, 2, 4, 8)
OURS, CERTIFIED = "palpate", "palpate, stability certified"
# Whose solution differs by more (of the largest displacement) has solved something else and is not compared.
AGREEMENT = 1e-4
# Solvers grow with the number of cells to this power or more: who cannot end in time is not tried.
GROWTH = 1.5
Round = dict[str, tuple[float, float]]  # wall-clock and processor seconds of each contender
SLOW_S = 10.0  # contenders slower than this are timed twice, not `repeats` times


class Summary(TypedDict):
    """Every contender's figures on one scene; the fastest peer that agrees, and how many times faster than it Palpate is."""

    palpate: Answer
    palpate_certified: Answer
    peers: dict[str, Answer]
    fastest_peer: str | None
    times_faster_than_fastest_peer: float | None
    by_processor_time: float | None


class Row(Summary):
    """The same with the scene: tetrahedra, unknowns, element, v1 / mu of the sphere, and how it is driven."""

    cells: int
    unknowns: int
    element: str
    v1_over_mu: float
    drive: str


def scenes(options: BenchOptions) -> list[BenchScene]:
    """Linear tetrahedra at every size, ratio and drive; other elements at one ratio and drive."""
    out = []
    for element in options.elements:
        costly = element != "p1"
        for cells in options.sizes:
            for ratio in (options.costly_ratio,) if costly else options.ratios:
                out += [BenchScene(cells, element, ratio, d) for d in options.drives[: 1 if costly else None]]
    return out


class EquilibriumTable:
    """Rows of the table, one scene each; remembers who was slow so that larger scenes do not wait for them."""

    def __init__(self, peers: Sequence[ContenderSpec], options: BenchOptions, folder: Path) -> None:
        self._specs = [ours(), ours(certify=True), *peers]
        self._options, self._folder = options, folder
        self._slowest: dict[tuple[str, str], tuple[int, float]] = {}
        self._answered: set[str] = set()

    def row(self, scene: BenchScene) -> Row:
        """Measure one scene. InputError where a child dies before it has answered on any."""
        path = self._folder / "scene.npz"
        size = write_scene(scene, path)
        running: dict[str, Contender] = {}
        results: dict[str, Answer] = {}
        try:
            for name, spec in zip(_names(self._specs), self._specs, strict=True):
                if scene.element in spec.elements:
                    results[name] = self._first(name, spec, scene, path, running)
            times = self._rounds(running, results)
        finally:
            for contender in running.values():
                contender.stop()
        return {
            "cells": size.cells,
            "unknowns": size.unknowns,
            "element": scene.element,
            "v1_over_mu": scene.ratio,
            "drive": scene.drive,
            **_summary(results, times, self._folder),
        }

    def _first(
        self, name: str, spec: ContenderSpec, scene: BenchScene, path: Path, running: dict[str, Contender]
    ) -> Answer:
        """Start and solve once: also the warm-up. Whoever fails is stopped and stays in the table with the reason."""
        cells, seconds = self._slowest.get((name, scene.element), (scene.cells, 0.0))
        expected = seconds * (scene.cells / cells) ** GROWTH
        if expected > self._options.limit_s:
            return {"reason": f"not tried: took {seconds:.0f} s at {cells} cells", "failures": []}
        contender = Contender.start(spec, path, self._options.limit_s)
        if contender.reason:
            self._refuse_a_dead_one(name, contender)
            return {"reason": contender.reason, "failures": []}
        answer = solve_with_fewest_steps(contender, self._options.rtol, self._folder / f"{_file(name)}.npy", LOAD_STEPS)
        self._refuse_a_dead_one(name, contender)
        self._answered.add(name)
        answer["version"] = contender.hello.get("version", "")
        self._slowest[name, scene.element] = (scene.cells, answer.get("seconds", 2.0 * self._options.limit_s))
        if answer["reason"]:
            contender.stop()
        else:
            running[name] = contender
        return answer

    def _refuse_a_dead_one(self, name: str, contender: Contender) -> None:
        """A program that dies on the first scene that it gets has not been compared; one that dies later has met its limit."""
        if contender.died and name not in self._answered:
            raise InputError(
                f"{name} did not run: {contender.reason}; mend it (it is started by {contender.spec.command[0]}), "
                "or name the other solvers with --peer"
            )

    def _rounds(self, running: dict[str, Contender], results: dict[str, Answer]) -> list[Round]:
        """Everyone in turn, round after round, so that what else the machine does meets all alike."""
        rounds: list[Round] = []
        for k in range(self._options.repeats):
            now: Round = {}
            for name, contender in running.items():
                if k >= 2 and results[name]["seconds"] > SLOW_S:
                    continue
                answer = contender.solve(results[name]["load_steps"], self._options.rtol)
                if answer["reason"] == "":
                    now[name] = (answer["seconds"], answer["cpu_seconds"])
            rounds.append(now)
        return rounds


def _names(specs: Sequence[ContenderSpec]) -> list[str]:
    return [CERTIFIED if "certify" in s.arguments else s.name for s in specs]


def _file(name: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in name)


def _summary(results: dict[str, Answer], rounds: list[Round], folder: Path) -> Summary:
    """Least seconds of each, ratios to ours, and the largest difference of the solutions."""
    reference = folder / f"{_file(OURS)}.npy"
    u = np.load(reference) if results[OURS]["reason"] == "" else None
    for name, result in results.items():
        _add_timing(result, name, rounds)
        if u is not None and name != OURS and result["reason"] == "":
            other = np.load(folder / f"{_file(name)}.npy")
            result["largest_difference_relative"] = float(np.abs(other - u).max() / np.abs(u).max())
    peers = {n: r for n, r in results.items() if n not in (OURS, CERTIFIED)}
    compared = {
        n: r["times_our_seconds"]
        for n, r in peers.items()
        if "times_our_seconds" in r and r["largest_difference_relative"] <= AGREEMENT
    }
    fastest = min(compared, key=lambda n: compared[n]) if compared else None
    return {
        "palpate": results[OURS],
        "palpate_certified": results[CERTIFIED],
        "peers": peers,
        "fastest_peer": fastest,
        "times_faster_than_fastest_peer": compared.get(fastest) if fastest else None,
        "by_processor_time": peers[fastest].get("times_our_cpu_seconds") if fastest else None,
    }


def _add_timing(result: Answer, name: str, rounds: list[Round]) -> None:
    """The least of all rounds is what the work takes; whatever else the machine does only adds to it."""
    own = [r[name] for r in rounds if name in r]
    ours_too = [r[OURS] for r in rounds if OURS in r]
    if not own:
        return
    wall, cpu = np.min(own, axis=0)
    result["seconds"], result["cpu_seconds"] = float(wall), float(cpu)
    if name == OURS or not ours_too:
        return
    our_wall, our_cpu = np.min(ours_too, axis=0)
    result["times_our_seconds"] = float(wall / our_wall)
    result["times_our_cpu_seconds"] = float(cpu / our_cpu)
    pairs = [r[name][0] / r[OURS][0] for r in rounds if name in r and OURS in r]
    result["times_our_seconds_median_of_pairs"] = median(pairs)
