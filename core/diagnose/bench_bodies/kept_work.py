"""Finished pieces of a diagnosis on a bench, kept in a file, so that a run that was stopped goes on where it was.

A piece is where a fit ended: its parameters, and the displacements that its last solve starts from. Whether the piece
is made or found, that last solve is the same, and with it every bit of the result.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.residual.joint_states import JointLinearisation, JointModel
from palpate.core.residual.linearised_model import Linearisation
from palpate.core.worker.checkpoint import Arrays, load_checkpoint, save_checkpoint

FILE = "finished.npz"


@dataclass(frozen=True, eq=False)
class Place:
    """Where a fit ended: theta (t,), phi (k,), displacements (n, 3) mm of every state. found : False for a fit that found
    no equilibrium."""

    theta: FloatArray
    phi: FloatArray
    displacements: Sequence[FloatArray]
    found: bool = True

    @classmethod
    def of(cls, at: JointLinearisation | None) -> Place:
        """Of a linearisation; None for a fit without one."""
        if at is None:
            return cls(np.zeros(0), np.zeros(0), [], found=False)
        return cls(at.theta, at.phi, [one.equilibrium.u for one in at.each])

    def on(self, model: JointModel) -> JointLinearisation:
        """The place as a linearisation to start from, of which only the displacements are read."""
        nothing = np.zeros(0)
        each = zip(model.each, self.displacements, strict=True)
        return JointLinearisation(
            tuple(
                Linearisation(
                    self.theta, self.phi, one.scene_of(one.plain), _resting(u), nothing, np.zeros((0, 0)), nothing
                )
                for one, u in each
            )
        )


@dataclass
class KeptWork:
    """Pieces by name. path, fingerprint : of the file and of the job; without a path they are kept in memory alone."""

    path: Path | None = None
    fingerprint: str = ""
    arrays: Arrays = field(default_factory=dict)

    @classmethod
    def load(cls, path: Path, fingerprint: str) -> KeptWork:
        """What a run of the same job has left at `path`; nothing where there is none."""
        return cls(path, fingerprint, load_checkpoint(path, fingerprint) or {})

    def place(self, name: str, make: Callable[[], JointLinearisation | None]) -> Place:
        """The place of this name; `make` finds it where it is not there yet."""
        if f"{name}/theta" not in self.arrays:
            made = Place.of(make())
            new = {f"{name}/phi": made.phi, f"{name}/found": np.array(made.found)}
            new |= {f"{name}/u{k}": u for k, u in enumerate(made.displacements)}
            self._keep(new | {f"{name}/theta": made.theta})
        found = bool(self.arrays[f"{name}/found"])
        count = sum(key.startswith(f"{name}/u") for key in self.arrays)
        u = [self._floats(f"{name}/u{k}") for k in range(count)]
        return Place(self._floats(f"{name}/theta"), self._floats(f"{name}/phi"), u, found)

    def numbers(self, name: str, make: Callable[[], FloatArray]) -> FloatArray:
        """Numbers of this name; `make` finds them where they are not there yet."""
        if name not in self.arrays:
            self._keep({name: make()})
        return self._floats(name)

    def _keep(self, new: Arrays) -> None:
        self.arrays |= new
        if self.path is not None:
            save_checkpoint(self.path, self.arrays, self.fingerprint)

    def _floats(self, name: str) -> FloatArray:
        return np.asarray(self.arrays[name], dtype=np.float64)


def _resting(u: FloatArray) -> Equilibrium:
    return Equilibrium(True, "", u, np.zeros(0), 1.0, None, 0.0, 1.0, 0, 0, 0)
