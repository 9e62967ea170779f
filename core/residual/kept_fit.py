"""The plain fit as arrays of a file, so that a diagnosis starts from what `identify` has found.

A diagnosis always works on a fit that went through these arrays, whether a file held them or it has just fitted: its
numbers are then the same to the last digit.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.state import State
from palpate.core.fem.tangent import Tangent
from palpate.core.files.json_types import typed
from palpate.core.forward.known_geometry import KnownGeometry
from palpate.core.inference.grid_posterior import GridPosterior
from palpate.core.inference.posterior import Posterior
from palpate.core.observe.contour_noise import Weighting
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.problem import StateData
from palpate.core.residual.covariance_family import CovarianceFamily
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.fit_options import FitOptions
from palpate.core.residual.joint_states import JointLinearisation
from palpate.core.residual.known_state import KnownState
from palpate.core.residual.linearised_model import NOTHING, Linearisation, StateModel
from palpate.core.residual.noise_covariance import NoiseSizes
from palpate.core.residual.noise_estimation import NoiseGrid
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.residual.state_models import joint_model

Arrays = Mapping[str, NDArray[np.generic]]
_OF_STATE = ("residual", "in_theta", "out_of_balance")
_OF_CORRECTION = ("theta", "value", "slope")
_OF_POSTERIOR = ("mean", "covariance", "singular_values", "bounds")
_OF_GRID = ("edges", "cumulative")


@dataclass(frozen=True)
class _Outcome:
    """Figures of an `Equilibrium`."""

    stable: bool | None
    residual: float
    min_jacobian: float
    factorisations: int
    backsolves: int
    load_steps: int
    buckled: bool

    @classmethod
    def of(cls, found: Equilibrium) -> _Outcome:
        return cls(**{f.name: getattr(found, f.name) for f in fields(cls)})


@dataclass(frozen=True)
class _Scalars:
    """What a fit holds beside its arrays; see `PlainFit`."""

    meshes: int
    scatter_mm: float | None
    sizes: NoiseSizes
    noise: list[NoiseSizes]
    scale: float
    outcomes: list[_Outcome]


def arrays_of(fit: PlainFit) -> dict[str, NDArray[np.generic]]:
    """For numpy.savez; `restored` is the inverse."""
    out: dict[str, NDArray[np.generic]] = {
        "theta": fit.linearisation.theta,
        **{f"correction/{key}": getattr(fit.model.correction, key) for key in _OF_CORRECTION},
        "weights": fit.weighting.covariance,
        "noise/matrices": fit.noise.covariances.matrices,
        "noise/coefficients": fit.noise.covariances.coefficients,
        "noise/log_prior": fit.noise.log_prior,
    }
    for k, (model, at) in enumerate(zip(fit.model.each, fit.linearisation.each, strict=True)):
        state: dict[str, NDArray[np.generic]] = {"u": at.equilibrium.u, "p": at.equilibrium.p}
        state |= {"walls_u": at.scene.linearised_at, **{key: getattr(at, key) for key in _OF_STATE}}
        state |= KnownState.of(model).arrays()
        if fit.shapes:
            state["shape"] = fit.shapes[k]
        out |= {f"{_prefix(k)}{key}": values for key, values in state.items()}
    if fit.on_own_mesh is not None:
        out["on_own_mesh"] = fit.on_own_mesh
    of_posterior = (*_OF_POSTERIOR, *(_OF_GRID if isinstance(fit.posterior, GridPosterior) else ()))
    out |= {f"posterior/{key}": getattr(fit.posterior, key) for key in of_posterior}
    scalars = _Scalars(
        fit.meshes,
        fit.scatter_mm if np.isfinite(fit.scatter_mm) else None,
        fit.sizes,
        list(fit.noise.sizes),
        fit.posterior.scale,
        [_Outcome.of(at.equilibrium) for at in fit.linearisation.each],
    )
    return out | {"scalars": np.frombuffer(json.dumps(asdict(scalars)).encode(), dtype=np.uint8)}


def restored(
    arrays: Arrays,
    pairs: Sequence[StateData],
    options: NoiseModelOptions,
    walls: WallMotionOptions,
    how: FitOptions,
) -> PlainFit:
    """The fit of these deformed states that `arrays_of` described, its tangents factorised again.

    options : of the case (`NoiseModelOptions.for_case`). Raises KeyError, ValueError or InputError where the arrays are
    those of no such fit.
    """
    stated = json.loads(bytes(np.asarray(arrays["scalars"], dtype=np.uint8)).decode())
    scalars = typed(stated, _Scalars, "a kept fit", "")
    states = [_under(arrays, _prefix(k)) for k in range(len(pairs))]
    model = joint_model(pairs, options, walls, how, [KnownState.from_arrays(state) for state in states])
    theta = _floats(arrays, "theta")
    model = model.corrected(ElementCorrection(*(_floats(arrays, f"correction/{key}") for key in _OF_CORRECTION)))
    parts = zip(model.each, states, scalars.outcomes, strict=True)
    here = JointLinearisation(tuple(_linearisation(one, state, theta, outcome) for one, state, outcome in parts))
    covariances = CovarianceFamily(_floats(arrays, "noise/matrices"), _floats(arrays, "noise/coefficients"))
    return PlainFit(
        model=model,
        linearisation=here,
        on_own_mesh=_floats(arrays, "on_own_mesh") if "on_own_mesh" in arrays else None,
        meshes=scalars.meshes,
        scatter_mm=float("nan") if scalars.scatter_mm is None else scalars.scatter_mm,
        noise=NoiseGrid(scalars.noise, covariances, _floats(arrays, "noise/log_prior"), options),
        sizes=scalars.sizes,
        weighting=Weighting(_floats(arrays, "weights")),
        shapes=tuple(_floats(state, "shape") for state in states if "shape" in state),
        posterior=_posterior(arrays, scalars.scale),
    )


def known_geometry(path: Path, state: int) -> KnownGeometry:
    """Geometry of one deformed state from the file of a fit. Raises what a damaged archive raises."""
    wanted = tuple(f"{_prefix(state)}{part}" for part in ("target/", "walls/", "slips/", "motion_reader"))
    with np.load(path, allow_pickle=False) as data:
        found = {name: data[name] for name in data.files if name.startswith(wanted)}
    return KnownGeometry.from_arrays(_under(found, _prefix(state)))


def _linearisation(model: StateModel, state: Arrays, theta: FloatArray, outcome: _Outcome) -> Linearisation:
    """The model where it was solved: the scene with its walls, and the tangent there."""
    scene = model.scene_of(model.plain)
    scene.linearise(_floats(state, "walls_u"))
    scene.assembler.set_materials(scene.materials(theta))
    u, p = _floats(state, "u"), _floats(state, "p")
    tangent = Tangent(scene.assembler, State(u, p))
    equilibrium = Equilibrium(True, "", u, p, 1.0, **vars(outcome), certified=tangent)
    residual, in_theta, out_of_balance = (_floats(state, key) for key in _OF_STATE)
    return Linearisation(theta, NOTHING, scene, equilibrium, residual, in_theta, out_of_balance)


def _posterior(arrays: Arrays, scale: float) -> Posterior:
    mean, covariance, singular_values, bounds = (_floats(arrays, f"posterior/{key}") for key in _OF_POSTERIOR)
    if f"posterior/{_OF_GRID[0]}" not in arrays:
        return Posterior(mean, covariance, singular_values, scale, bounds)
    edges, cumulative = (_floats(arrays, f"posterior/{key}") for key in _OF_GRID)
    return GridPosterior(mean, covariance, singular_values, scale, bounds, edges, cumulative)


def _under(arrays: Arrays, prefix: str) -> dict[str, NDArray[np.generic]]:
    return {key.removeprefix(prefix): arrays[key] for key in arrays if key.startswith(prefix)}


def _prefix(state: int) -> str:
    return f"state_{state + 1}/"


def _floats(arrays: Arrays, key: str) -> FloatArray:
    return np.ascontiguousarray(arrays[key], dtype=np.float64)
