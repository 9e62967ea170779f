"""Reduced model of one scene: displacement as a function of a few parameters, in microseconds, with an error estimate.

Displacements at chosen parameters (and their sensitivities, which a solve gives away) are written in a small
orthonormal basis whose coefficients are interpolated over the parameter box (`kernel_interpolation`). Where its
estimate exceeds a tolerance the caller solves in full. No hyper-reduction: an equilibrium depends on ln G so smoothly
that interpolation reaches its error with fewer solves.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.errors import InputError
from palpate.core.reduced.greedy_design import Design, ReducedOptions, Solve, explore
from palpate.core.reduced.kernel_interpolation import Features, power
from palpate.core.worker.checkpoint import load_checkpoint, save_checkpoint
from palpate.core.worker.progress import Progress, silent

FORMAT = 1


def _fingerprint(scene: str) -> str:
    return f"reduced-model-{FORMAT}-{scene}"


def scene_hash(*parts: NDArray[np.generic] | str | float) -> str:
    """SHA-256 of whatever defines a scene: arrays (shape, type and bytes), words and numbers, in order."""
    digest = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            digest.update(f"{part.dtype.str}{part.shape}".encode())
            digest.update(np.ascontiguousarray(part).tobytes())
        else:
            digest.update(f"|{type(part).__name__}:{part!r}|".encode())
    return digest.hexdigest()


@dataclass(frozen=True, eq=False)
class ReducedModel:
    """u(theta) at n points for theta in a box.

    bounds : (k, 2). scene : hash of the scene it stands for. features, coefficients (f, r), explained (d, f) :
    interpolant. modes : (r, 3 n) mm. calibration : mm per unit of power function. dropped : mm, lost by keeping few
    modes. scale : mm, the largest displacement of the particle that moves least. tolerance : relative to it, as asked
    for. worst_estimate : mm, anywhere in the box. solves, failed : full solves spent, and those without an equilibrium.
    """

    bounds: FloatArray
    scene: str
    features: Features
    coefficients: FloatArray
    explained: FloatArray
    modes: FloatArray
    calibration: float
    dropped: float
    scale: float
    tolerance: float
    worst_estimate: float
    solves: int
    failed: int

    @classmethod
    def build(
        cls,
        solve: Solve,
        bounds: FloatArray,
        scene: str,
        options: ReducedOptions | None = None,
        progress: Progress = silent,
    ) -> ReducedModel:
        """Solve in full where it is needed, until `options.tolerance` holds. bounds (k, 2), 1 to 4 parameters in
        practice.

        Raises ConvergenceError when most of the first solves fail, InputError for bounds that are not a box.
        """
        bounds = np.asarray(bounds, dtype=float)
        if bounds.ndim != 2 or bounds.shape[1] != 2 or not (bounds[:, 0] < bounds[:, 1]).all():
            raise InputError(
                f"bounds {bounds.tolist()} are not a box; give a lower and a higher bound of each parameter"
            )
        options = options or ReducedOptions()
        return _assembled(explore(solve, bounds, options, progress), bounds, scene, options)

    @property
    def n_points(self) -> int:
        """Number of points whose displacement is predicted."""
        return self.modes.shape[1] // 3

    def evaluate(self, theta: FloatArray) -> FloatArray:
        """Displacement (n, 3) mm at theta (k,), or (m, n, 3) at (m, k). Outside the box: that of the nearest point of
        the box.
        """
        x, one = self._unit(theta)
        u = (self.features.values(x) @ self.coefficients @ self.modes).reshape(len(x), -1, 3)
        return u[0] if one else u

    def gradient(self, theta: FloatArray) -> FloatArray:
        """du/dtheta (k, n, 3) mm at theta (k,), or (m, k, n, 3) at (m, k)."""
        x, one = self._unit(theta)
        slopes = self.features.gradients(x) / self._half[:, None]
        g = (slopes @ self.coefficients @ self.modes).reshape(*slopes.shape[:2], -1, 3)
        return g[0] if one else g

    def error_estimate(self, theta: FloatArray) -> FloatArray:
        """Estimated error of the worst point, mm, () or (m,); infinite outside the box.

        The power function times the norm that leave-one-out errors need, times a safety factor: meant to lie above the
        error.
        """
        x, one = self._unit(theta)
        estimate = self.calibration * power(self.features, self.explained, x) + self.dropped
        estimate = np.where(self._inside(theta), estimate, np.inf)
        return estimate[0] if one else estimate

    def save(self, path: Path) -> None:
        """Write as npz without pickle; an older file stays whole until the new one is. Raises InputError when it
        cannot.
        """
        arrays = {name: np.asarray(getattr(self, name)) for name in _STORED}
        arrays.update(powers=self.features.powers, rho=np.asarray(self.features.rho))
        save_checkpoint(path, arrays, _fingerprint(self.scene))

    @classmethod
    def load(cls, path: Path, scene: str) -> ReducedModel | None:
        """The model in a file; None when there is none, it is damaged, or it stands for another scene (then build it
        anew).
        """
        arrays = load_checkpoint(path, _fingerprint(scene))
        if arrays is None:
            return None
        stored: dict[str, Any] = {name: arrays[name] if arrays[name].ndim else arrays[name].item() for name in _STORED}
        return cls(
            scene=scene, features=Features(np.asarray(arrays["powers"], dtype=np.int64), float(arrays["rho"])), **stored
        )

    @property
    def _half(self) -> FloatArray:
        return 0.5 * (self.bounds[:, 1] - self.bounds[:, 0])

    def _unit(self, theta: FloatArray) -> tuple[FloatArray, bool]:
        rows = np.atleast_2d(np.asarray(theta, dtype=float))
        return np.clip((rows - self.bounds.mean(axis=1)) / self._half, -1.0, 1.0), np.ndim(theta) == 1

    def _inside(self, theta: FloatArray) -> BoolArray:
        rows, margin = np.atleast_2d(np.asarray(theta, dtype=float)), 1e-9 * self._half
        within = (rows >= self.bounds[:, 0] - margin) & (rows <= self.bounds[:, 1] + margin)
        return np.asarray(within.all(axis=1), dtype=bool)


_STORED = (
    "bounds",
    "coefficients",
    "explained",
    "modes",
    "calibration",
    "dropped",
    "scale",
    "tolerance",
    "worst_estimate",
    "solves",
    "failed",
)


def _assembled(design: Design, bounds: FloatArray, scene: str, options: ReducedOptions) -> ReducedModel:
    """Rotated modes without those that change no snapshot by more than a fiftieth of the tolerance.

    The error estimate includes what they would have changed.
    """
    rows = design.data.reshape(-1, design.data.shape[2])
    _, _, V = np.linalg.svd(rows, full_matrices=False)
    values = design.data[:, 0] @ V.T
    tails = np.sqrt(
        np.cumsum((values**2)[:, ::-1], axis=1)[:, ::-1].max(axis=0)
    )  # what is lost by keeping only modes before i
    allowed = 0.02 * options.tolerance * design.scale
    keep = int((tails > allowed).sum())
    return ReducedModel(
        bounds=bounds,
        scene=scene,
        features=design.fit.features,
        coefficients=design.fit.coefficients @ V[:keep].T,
        explained=design.fit.explained,
        modes=V[:keep] @ design.modes,
        calibration=design.calibration,
        dropped=float(tails[keep]) if keep < len(tails) else 0.0,
        scale=design.scale,
        tolerance=options.tolerance,
        worst_estimate=design.worst,
        solves=len(design.x) + len(design.failed),
        failed=len(design.failed),
    )
