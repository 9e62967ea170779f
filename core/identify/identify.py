"""Identification of region stiffness with its uncertainty: the plain fit, and a swarm that searches the whole range."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.state import State
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.swarm_run import SwarmOutcome
from palpate.core.identify.swarm_stage import search_with_swarm
from palpate.core.identify.uneven_regions import UNEVEN_SD, uneven_responses
from palpate.core.inference.posterior import Posterior
from palpate.core.residual.case_data import load_state
from palpate.core.residual.contours_alone import answer, misleading_contours
from palpate.core.residual.fit_file import FILE, FitQuestion, save_fit
from palpate.core.residual.fit_options import FitOptions
from palpate.core.residual.joint_states import JointLinearisation, JointModel, apart
from palpate.core.residual.likely_slip import slid
from palpate.core.residual.plain_fit import FoundFit, fit_plain
from palpate.core.worker.messages import Reporter
from palpate.core.worker.progress import part

# Units of the misfit (its noise has a standard deviation of 1 along each direction) by which the swarm must lie lower
# for Gauss-Newton to start again from there.
_LOWER = 1.0


@dataclass(frozen=True, eq=False)
class Solution:
    """One deformed state at the stiffness found, walls settled. element : the one chosen, or the quick one where that
    has no equilibrium."""

    scene: CompositionScene
    equilibrium: Equilibrium
    element: str


@dataclass(frozen=True, eq=False)
class Identification:
    """Result of one identification.

    fit : the plain model where it fits best; its posterior is the answer, unless contours alone mislead. solutions : of
    every deformed state. swarm : result of the swarm, None without that method. reduced_evaluations : of the reduced
    models. seconds : wall-clock time.
    """

    fit: FoundFit
    solutions: tuple[Solution, ...]
    swarm: SwarmOutcome | None
    reduced_evaluations: int
    seconds: float

    @property
    def theta(self) -> FloatArray:
        """Parameters (t,) as in `StiffnessParameters`."""
        return self.fit.linearisation.theta

    @cached_property
    def untold(self) -> str:
        """Why the fit's stiffness is no answer (`misleading_contours`); "" where it is one."""
        return misleading_contours(self.fit)

    @property
    def posterior(self) -> Posterior:
        """Of all of theta; that of data without information where the fit is no answer."""
        return answer(self.fit)

    @property
    def scene(self) -> CompositionScene:
        """Scene of the first state, the one that pictures show."""
        return self.solutions[0].scene

    @property
    def equilibrium(self) -> Equilibrium:
        """Equilibrium of the first state."""
        return self.solutions[0].equilibrium

    @property
    def starts_agree(self) -> bool:
        """Whether all starts of Gauss-Newton end at the same stiffness."""
        return self.fit.optimum.agree(self.scene.parameters.stiffness)

    @property
    def agreement(self) -> float:
        """Largest absolute difference of ln G between swarm and Gauss-Newton; 0 without a swarm."""
        if self.swarm is None:
            return 0.0
        return float(np.abs(self.swarm.theta - self.theta)[self.scene.parameters.stiffness].max())

    @property
    def stiffness(self) -> Posterior:
        """Marginal posterior of the regions' ln G."""
        return self.posterior.of(self.scene.parameters.stiffness)


def identify(
    folder: Path, files: Sequence[Path], options: IdentifyOptions, fingerprint: str, reporter: Reporter
) -> Identification:
    """One stiffness for several deformed states of the same mesh.

    files : of each state, as `arrays_of_state` gives it. Checkpoints are written into `folder`; a later run with the
    same fingerprint continues from them. Raises InputError for a problem that cannot be set up, ConvergenceError when
    no start of the search has an equilibrium.
    """
    began = time.perf_counter()
    reporter.progress(0.0, "building the model")
    pairs = [load_state(file) for file in files]
    how = FitOptions(
        boundary=options.boundary, element=options.element, starts=options.starts, split_mu=options.split_mu
    )
    further = _uneven if options.uneven else None
    fit = fit_plain(pairs, progress=part(reporter.progress, 0.0, 0.4), how=how, further=further)
    save_fit(folder / FILE, fit, FitQuestion(pairs=pairs, how=how, further="uneven" if options.uneven else "").key())
    reporter.checkpoint(folder / FILE, 0)  # a diagnosis may start from it
    swarm, reduced = None, 0
    if options.method == "swarm":
        swarm, reduced = search_with_swarm(folder, files, fit, options, fingerprint, reporter)
        if swarm.misfit < float(fit.residual @ fit.residual) - _LOWER:
            before, fit = fit.count, fit_plain(pairs, how=how, further=further, start=swarm.theta)
            fit.count.include(before)
    reporter.progress(0.92, "uncertainty")
    solutions = tuple(_solution(fit, k, options.element) for k in range(len(pairs)))
    return Identification(fit, solutions, swarm, reduced, time.perf_counter() - began)


def _solution(fit: FoundFit, state: int, element: str) -> Solution:
    """State solved to the end at the fit, with its stability check, walls where the data have them."""
    fine, quick = fit.fine[state], fit.linearisation.each[state]
    starts = [] if fine is None else [(fine.scene, fine.state, element)]
    quickly = State(quick.equilibrium.u, quick.equilibrium.p)
    for scene, start, name in [*starts, (quick.scene, quickly, quick.scene.geometry.element)]:
        there = slid(fit, state, scene)
        equilibrium = there.settle(quick.theta, start, rounds=2).equilibrium
        fit.count.add(equilibrium)
        if equilibrium.converged:
            return Solution(there, equilibrium, name)
    return Solution(quick.scene, quick.equilibrium, quick.scene.geometry.element)


def _uneven(model: JointModel, at: JointLinearisation) -> FloatArray:
    """Response (n, m) of the data to a stiffness that is not uniform within each region; see `uneven_responses`."""
    return apart(
        [
            UNEVEN_SD
            * np.hstack(
                uneven_responses(
                    p.scene.assembler,
                    p.scene.parameters,
                    p.theta,
                    p.equilibrium,
                    lambda field, m=m, p=p: m.data.response(p.scene, p.equilibrium.u, field[None])[:, 0],  # type: ignore[misc]
                )
            )
            for m, p in zip(model.each, at.each, strict=True)
        ]
    )
