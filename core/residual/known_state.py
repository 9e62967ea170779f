"""What is dear to find of one deformed state before anything is solved, as arrays for a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import FloatArray
from palpate.core.forward.known_geometry import KnownGeometry
from palpate.core.observe.bone_registration import BoneRegistration
from palpate.core.observe.surface_observation import SurfaceObservation
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.linearised_model import StateModel
from palpate.core.surfaces.distance_field import SignedDistanceField

_OF_BONE = ("points", "design", "reader", "misfit", "floor_sd")
_OF_FIELD = ("coefficients", "origin", "spacing")


@dataclass(frozen=True, eq=False)
class KnownState:
    """geometry : distance fields and slips. modes (q, k), bone : see `DataVector`."""

    geometry: KnownGeometry
    modes: FloatArray
    bone: BoneRegistration | None

    @classmethod
    def of(cls, model: StateModel) -> KnownState:
        """What a model holds."""
        return cls(model.geometry.known, model.data.modes, model.data.bone)

    def data(self, observation: SurfaceObservation) -> DataVector:
        """The data vector of the state's observation."""
        return DataVector(self.modes, len(observation.landmarks), self.bone, observation.motion.covariance)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """For numpy.savez; `from_arrays` is the inverse."""
        out: dict[str, NDArray[np.generic]] = {"modes": self.modes, **self.geometry.arrays()}
        if self.bone is not None:
            out |= {f"bone/{key}": getattr(self.bone, key) for key in _OF_BONE}
            out |= {f"bone/field/{key}": values for key, values in self.bone.field.arrays().items()}
        return out

    @classmethod
    def from_arrays(cls, data: Mapping[str, NDArray[np.generic]]) -> KnownState:
        """Raises KeyError where arrays are missing."""
        return cls(KnownGeometry.from_arrays(data), np.asarray(data["modes"], dtype=np.float64), _bone(data))


def _bone(data: Mapping[str, NDArray[np.generic]]) -> BoneRegistration | None:
    if "bone/points" not in data:
        return None
    found = {key: np.asarray(data[f"bone/{key}"], dtype=np.float64) for key in _OF_BONE}
    field = SignedDistanceField.from_arrays({key: data[f"bone/field/{key}"] for key in _OF_FIELD})
    return BoneRegistration(field=field, **found)
