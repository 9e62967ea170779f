"""A case whose model is linear, on arrays: a plain fit, and effects that add columns to its residual.

Everything that decides sees what it sees of a finite element model, and every evidence has a closed form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from scipy.stats import multivariate_normal

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.detection.score_test import Screened, screen
from palpate.core.forward.effect import Effect, Parameter, Variant
from palpate.core.inference.evidence import Directions
from palpate.core.inference.posterior import laplace, prior_precision
from palpate.core.observe.contour_noise import Weighting
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.joint_states import JointLinearisation, JointModel
from palpate.core.residual.linearised_model import Hypothesis, Linearisation
from palpate.core.residual.noise_covariance import NoiseSizes
from palpate.core.residual.noise_estimation import NoiseGrid
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.plain_fit import PlainFit

N, BOUNDS = 60, np.tile(np.log([5.0, 500.0]), (2, 1))
NUMBERS = NoiseModelOptions()


@dataclass(eq=False)
class LinearModel:
    """residual = r + J (theta - theta_0) + what the hypothesis adds + correction. unsolvable : names of variants without an equilibrium.
    remeshed : names of those that change the stress-free mesh. solved : (theta, phi) of every solve."""

    r: FloatArray
    J: FloatArray
    theta: FloatArray
    correction: ElementCorrection
    unsolvable: tuple[str, ...] = ()
    remeshed: tuple[str, ...] = ()
    each: list[None] = field(default_factory=lambda: [None])
    solved: list[FloatArray] = field(default_factory=list)

    def solve(
        self, hypothesis: Hypothesis, theta: FloatArray, phi: FloatArray, near: object
    ) -> JointLinearisation | None:
        """See `JointModel.solve`."""
        name = "" if hypothesis.variant is None else hypothesis.variant.name
        self.solved.append(np.concatenate([theta, phi]))
        if name in self.unsolvable:
            return None
        added = cast(FloatArray, hypothesis.composition(cast(Any, np.zeros(len(self.r))), phi))
        residual = self.r + self.J @ (theta - self.theta) + added + self.correction.at(theta)
        geometry = object() if name in self.remeshed else None
        scene: Any = SimpleNamespace(
            parameters=SimpleNamespace(bounds=BOUNDS), composition=SimpleNamespace(geometry=geometry)
        )
        empty: Any = np.zeros(0)
        return JointLinearisation((Linearisation(theta, phi, scene, empty, residual, self.J, empty),))

    @property
    def bounds(self) -> FloatArray:
        """See `JointModel.bounds`."""
        return BOUNDS

    def plain(self, theta: FloatArray, near: object) -> JointLinearisation | None:
        """See `JointModel.plain`."""
        return self.solve(Hypothesis(), theta, np.zeros(0), near)

    def directions(self, hypothesis: Hypothesis, at: JointLinearisation) -> FloatArray:
        """See `JointModel.directions`."""
        assert hypothesis.variant is not None
        unit = np.eye(hypothesis.n)
        return np.stack([cast(FloatArray, hypothesis.variant.change(cast(Any, np.zeros(N)), e)) for e in unit], axis=1)

    def corrected(self, correction: ElementCorrection) -> LinearModel:
        """See `JointModel.corrected`."""
        return replace(self, correction=correction)


@dataclass(eq=False)
class LinearCase:
    """covariance (n, n) of the noise; fit : the plain model's, at its optimum; effects by id."""

    covariance: FloatArray
    fit: PlainFit
    effects: dict[str, Effect]

    @classmethod
    def of(cls, effects: Sequence[Effect], hidden: FloatArray, seed: int = 3, **model: tuple[str, ...]) -> LinearCase:
        """hidden (n,) : what is in the data beside noise and stiffness."""
        rng = np.random.default_rng(seed)
        at = np.arange(N)
        C = 0.16 * np.exp(-0.5 * ((at[:, None] - at) / 2.0) ** 2) + 0.04 * np.eye(N)
        J = 6.0 * rng.standard_normal((N, 2))
        weighting = Weighting(C)
        r = np.linalg.cholesky(C) @ rng.standard_normal(N) - hidden
        white = weighting.whiten(np.column_stack([J, r]))
        theta = np.log([20.0, 60.0])
        best = theta - np.linalg.lstsq(white[:, :2], white[:, 2], rcond=None)[0]
        stub: Any = LinearModel(r, J, theta, ElementCorrection.none(N), **model)
        plain = stub.solve(Hypothesis(), best, np.zeros(0), None)
        return cls(C, fit_on_arrays(stub, plain, C), {effect.id: effect for effect in effects})

    @property
    def screened(self) -> list[Screened]:
        """Every effect, looked at; see `score_test.screen`."""
        nothing: Any = None
        return screen(self.fit, self.effects, nothing)

    def looked_at(self, name: str) -> Screened:
        """One effect."""
        return next(s for s in self.screened if s.effect.id == name)

    def evidence(self, columns: FloatArray, scales: FloatArray) -> float:
        """Log Bayes factor against nothing of columns (n, k) whose amplitudes are normal about 0 with sd scales (k,), in closed form."""
        r, J = self.fit.linearisation.residual, self.fit.linearisation.in_theta
        plain = self.covariance + J @ np.diag(1.0 / prior_precision(BOUNDS)) @ J.T
        more = plain + (columns * scales**2) @ columns.T
        zero = np.zeros(N)
        return float(multivariate_normal.logpdf(r, zero, more) - multivariate_normal.logpdf(r, zero, plain))


def fit_on_arrays(model: Any, at: JointLinearisation, covariance: FloatArray) -> PlainFit:
    """The plain fit of a model that stands in for `JointModel`, where it fits best; covariance (n, n) of its noise, which is known."""
    weighting = Weighting(covariance)
    return PlainFit(
        model=cast(JointModel, model),
        linearisation=at,
        on_own_mesh=None,
        meshes=1,
        scatter_mm=float("nan"),
        noise=NoiseGrid.known(covariance, NUMBERS),
        sizes=NoiseSizes.of(NUMBERS),
        weighting=weighting,
        posterior=laplace(at.theta, weighting.whiten(at.residual), weighting.whiten(at.in_theta), BOUNDS),
    )


def column(seed: int, size: float = 1.0) -> FloatArray:
    """What an effect adds to the data, (n, 1)."""
    return size * np.random.default_rng([seed, 7]).standard_normal((N, 1))


def effect(name: str, *columns: FloatArray, scale: float = 1.0, low: float = -np.inf, high: float = np.inf) -> Effect:
    """An effect of one parameter for each column of a variant; a variant for each of columns (n, k)."""
    k = columns[0].shape[1]
    parameters = [Parameter(f"size_{j}", "1", scale, low, high) for j in range(k)]

    def variant(number: int, S: FloatArray) -> Variant:
        return Variant(cast(Any, lambda composition, phi: composition + S @ phi), f"{name}_{number}")

    return Effect(name, name, parameters, lambda around: [variant(i, S) for i, S in enumerate(columns)], "")


def free_field(columns: FloatArray) -> list[Directions]:
    """A cause without a name, (n, k)."""
    return [Directions.at_zero(columns, np.ones(columns.shape[1]))]
