"""Are the map's errors what it says, and which focus can it find? On arrays, and on bodies solved with another element and mesh."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.case.steps.diagnose import remeshed
from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError, InputError
from palpate.core.identify.map.local_field import LocalField
from palpate.core.identify.map.stiffness_map import StiffnessMap
from palpate.core.statistics import rms
from palpate.core.worker.progress import Progress, part, silent
from palpate.validate.stiffness_map.case_map import CaseMap
from palpate.validate.stiffness_map.records import (
    DIAMETERS_MM,
    TIMES,
    CoverRow,
    FocusRow,
    MapStudyOptions,
    MapTable,
)
from palpate.validate.stiffness_map.solved import Focus, OtherBody

# Steps of both halves' ln G of solved bodies without a focus.
_STEPS = ((0.0, 0.0), (0.3, -0.3), (-0.3, 0.3))


@dataclass
class _Cover:
    """Errors over what is stated, of the organ's places with their shares of its volume; and how many maps call a place."""

    truths: str
    scores: list[FloatArray] = field(default_factory=list)
    shares: list[FloatArray] = field(default_factory=list)
    called: int = 0

    def add(self, found: StiffnessMap, ln_G: FloatArray) -> None:
        volumes = found.patches.volumes
        self.scores.append((found.ln_G - ln_G) / found.sd)
        self.shares.append(volumes / volumes.sum())
        self.called += int(found.called.any())

    def within(self, k: float) -> float:
        return float(np.mean([share[np.abs(z) < k].sum() for z, share in zip(self.scores, self.shares, strict=True)]))

    @property
    def row(self) -> CoverRow:
        square = [float(share @ z**2) for z, share in zip(self.scores, self.shares, strict=True)]
        return CoverRow(
            truths=self.truths,
            pairs=len(self.scores),
            within_one=self.within(1.0),
            within_two=self.within(2.0),
            scores=rms(np.sqrt(square)),
            called=self.called / len(self.scores),
        )


@dataclass
class _Finds:
    """Maps of one kind of focus."""

    focus: tuple[float, float]
    cover: _Cover
    found: int = 0
    elsewhere: int = 0

    def add(self, made: StiffnessMap, focus: Focus, ln_G: FloatArray) -> None:
        self.cover.add(made, ln_G)
        stiffer = made.called > 0
        reach = 0.5 * (focus.diameter_mm + np.cbrt(6.0 * made.patches.volumes / np.pi))
        touches = np.linalg.norm(made.patches.centres - focus.centre, axis=1) < reach
        self.found += int((stiffer & touches).any())
        self.elsewhere += int(stiffer.any() and not (stiffer & touches).any())

    @property
    def row(self) -> FocusRow:
        n = len(self.cover.scores)
        return FocusRow(
            diameter_mm=self.focus[0], times=self.focus[1], pairs=n, found=self.found / n, elsewhere=self.elsewhere / n,
            within_two=self.cover.within(2.0),
        )  # fmt: skip


def map_study(options: MapStudyOptions, progress: Progress = silent) -> MapTable:
    """Raises InputError for cases that are not identified or cannot be meshed, ConvergenceError where a body has no equilibrium."""
    rng = np.random.default_rng(options.seed)
    uniform, varied = _Cover("uniform, on arrays"), _Cover("drawn from the prior, on arrays")
    solved, real = _Cover("uniform, solved"), _Cover("uniform, the cases themselves")
    finds = {(d, t): _Finds((d, t), _Cover("")) for d in DIAMETERS_MM for t in TIMES}
    for k, path in enumerate(options.cases):
        here = part(progress, k / len(options.cases), (k + 1) / len(options.cases))
        here(0.0, f"{path}: fit and map")
        of = CaseMap.of(CaseFolder(path), part(here, 0.0, 0.2))
        on_arrays(of, uniform, varied, options.draws, rng)
        truth = known_truth(of)
        if truth is not None:
            real.add(of.found, of.found.patches.members @ truth)
        others = remeshed(of.case, 1)
        if not others:
            raise InputError(f"{path}: the labels at rest could not be meshed anew")
        on_solved(of, OtherBody(of, others[0]), solved, list(finds.values()), options, rng, part(here, 0.3, 1.0))
    progress(1.0, "done")
    return MapTable(
        study="map",
        seed=options.seed,
        cases=[str(path) for path in options.cases],
        cover=[cover.row for cover in (uniform, varied, solved, real) if cover.scores],
        foci=[found.row for found in finds.values() if found.cover.scores],
    )


def on_arrays(of: CaseMap, uniform: _Cover, varied: _Cover, draws: int, rng: np.random.Generator) -> None:
    """Truth and noise drawn from the model itself."""
    S, theta = _sensitivities(of.field), of.fit.linearisation.theta
    base = of.found.patches.members @ theta
    for _ in range(draws):
        for cover, d in ((uniform, np.zeros(len(base))), (varied, _from_prior(of.field, rng))):
            cover.add(of.mapped(S @ -d + rng.standard_normal(len(S))), base + d)


def on_solved(
    of: CaseMap,
    body: OtherBody,
    uniform: _Cover,
    finds: Sequence[_Finds],
    options: MapStudyOptions,
    rng: np.random.Generator,
    progress: Progress = silent,
) -> None:
    """Bodies without a focus and with one, each seen through several draws of noise."""
    regions = of.found.patches.regions
    base = of.found.patches.members @ of.fit.linearisation.theta
    for step in _STEPS:
        change = np.array(step[: len(regions)])
        residual = body.residual(change)
        for _ in range(options.draws):
            truth = base + of.found.patches.members @ change
            uniform.add(of.mapped(residual + rng.standard_normal(len(residual))), truth)
    kinds = [(one, place) for place in range(options.places) for one in finds]
    for k, (one, place) in enumerate(kinds):
        progress(k / len(kinds), f"focus of {one.focus[0]:g} mm, {one.focus[1]:g} times as stiff")
        for focus, residual in _with_focus(body, one.focus, regions[place % len(regions)], rng):
            d = _patch_means(of, body, focus)
            for _ in range(options.draws):
                one.add(of.mapped(residual + rng.standard_normal(len(residual))), focus, base + d)


def known_truth(of: CaseMap) -> FloatArray | None:
    """ln G (t,) of the halves, where the case is one of `validate images` and its answer lies beside it; None elsewhere, and where
    something is hidden in it."""
    pair = of.case.path.resolve().parent
    answer = pair.parent.parent / "answers" / f"{pair.name}.json"
    if not answer.exists():
        return None
    truth = json.loads(answer.read_text(encoding="utf-8"))
    if truth["hidden"] is not None:
        return None
    names = [of.problem.region_names[r] for r in of.found.patches.regions]
    return np.log(np.array([float(truth["true_G_kpa"][name]) for name in names]))


def _sensitivities(field: LocalField) -> FloatArray:
    return field.onto @ field.reduced


def _from_prior(field: LocalField, rng: np.random.Generator) -> FloatArray:
    chosen = field.candidates[rng.choice(len(field.candidates), p=[c.prior for c in field.candidates])]
    values, vectors = np.linalg.eigh(field.prior_covariance(chosen))
    return np.asarray(vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(len(values))))


def _with_focus(
    body: OtherBody, kind: tuple[float, float], region: int, rng: np.random.Generator
) -> Iterator[tuple[Focus, FloatArray]]:
    """One focus of this kind within a region and the data of its body; none where it finds no room or has no equilibrium."""
    centres = body.ball_centres(region, kind[0])
    if not len(centres):
        return
    x, y, z = (float(v) for v in centres[rng.integers(len(centres))])
    focus = Focus((x, y, z), *kind)
    try:
        yield focus, body.residual(np.zeros(len(body.theta)), focus)
    except ConvergenceError:
        return


def _patch_means(of: CaseMap, body: OtherBody, focus: Focus) -> FloatArray:
    """(n,) mean deviation of ln G over each patch."""
    mesh, patches = of.problem.mesh, of.found.patches
    volumes = mesh.volumes[patches.cells]
    return np.asarray(
        np.bincount(patches.patch, body.means(focus, mesh)[patches.cells] * volumes, patches.n) / patches.volumes
    )


def study_text(found: MapTable) -> str:
    """The table for a person."""
    lines = [f"{'truths':34}{'pairs':>7}{'within 1 sd':>13}{'within 2 sd':>13}{'z rms':>8}{'a place called':>16}"]
    lines += [
        f"{r['truths']:34}{r['pairs']:7}{100 * r['within_one']:11.0f} %{100 * r['within_two']:11.0f} %{r['scores']:8.2f}"
        f"{100 * r['called']:14.1f} %"
        for r in found["cover"]
    ]
    lines.append(
        f"{'focus':>9}{'times as stiff':>16}{'pairs':>7}{'found':>9}{'called elsewhere':>18}{'within 2 sd':>13}"
    )
    lines += [
        f"{r['diameter_mm']:6.0f} mm{r['times']:16.0f}{r['pairs']:7}{100 * r['found']:7.0f} %{100 * r['elsewhere']:16.1f} %"
        f"{100 * r['within_two']:11.0f} %"
        for r in found["foci"]
    ]
    return "\n".join(lines)
