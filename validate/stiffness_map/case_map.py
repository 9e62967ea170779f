"""The map of an identified case as an estimator: from any weighted data to a map, the halves' values fitted anew."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.case.case_data import data_of
from palpate.case.case_folder import CaseFolder
from palpate.case.identified import read_result
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.files.json_types import known
from palpate.core.forward.composition_scene import plain_scene
from palpate.core.identify.map.local_field import LocalField, Regional
from palpate.core.identify.map.stiffness_map import StiffnessMap, stiffness_map
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.problem import Facts, IdentificationProblem
from palpate.core.residual.fit_file import FILE, fit_of
from palpate.core.residual.likely_slip import slid
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.worker.progress import Progress, silent


@dataclass(frozen=True, eq=False)
class CaseMap:
    """fit : of the case. found : its map."""

    case: CaseFolder
    problem: IdentificationProblem
    fit: PlainFit
    found: StiffnessMap

    @classmethod
    def of(cls, case: CaseFolder, progress: Progress = silent) -> CaseMap:
        """Of an identified case. Raises InputError where it is not one, or has several deformed states."""
        options = known(read_result(case).options)
        data = data_of(case, bool(options and options.image), options.law if options else Facts.organ_law)
        if data.more:
            raise InputError(
                f"{case.path}: the study takes cases with one deformed state; this one has {len(data.pairs)}"
            )
        fit, _ = fit_of(data, NoiseModelOptions(), WallMotionOptions(), [case.file(f"identify/{FILE}")], progress)
        scene = slid(fit, 0, plain_scene(data.problem, "p2p1" if options is None else options.element))
        settled = scene.settle(fit.linearisation.theta)
        if not settled.equilibrium.converged:
            raise InputError(f"{case.path}: no equilibrium at the stiffness found; run `palpate identify` on it again")
        return cls(case, data.problem, fit, stiffness_map(fit, [(scene, settled.equilibrium)]))

    @property
    def field(self) -> LocalField:
        """The deviation's model."""
        return self.found.local.model

    @property
    def J(self) -> FloatArray:
        """(n, t) derivative of the weighted data in the halves' ln G."""
        return np.asarray(self.fit.jacobian / self.fit.posterior.scale, dtype=np.float64)

    @cached_property
    def covariance(self) -> FloatArray:
        """(t, t) of the halves' ln G that linear data leave."""
        return np.asarray(np.linalg.inv(self.J.T @ self.J), dtype=np.float64)

    def weighted(self, residual: FloatArray) -> FloatArray:
        """(n,) of a residual (n,) mm."""
        return self.fit.weighting.whiten(residual) / self.fit.posterior.scale

    def mapped(self, residual: FloatArray) -> StiffnessMap:
        """Map of weighted data whose residual at the case's own values is (n,); the halves' values fitted to it."""
        step = -self.covariance @ (self.J.T @ residual)
        regional = Regional(self.fit.linearisation.theta + step, self.covariance)
        made = StiffnessMap.of(self.field.posterior(residual + self.J @ step))
        return StiffnessMap(made.patches, regional, made.local, made.called)
