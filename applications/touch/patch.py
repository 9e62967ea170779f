"""The contact problem of a linear body, on the few nodes of its surface that are near the probe."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from palpate.applications.touch.probe import Blocks, Contact
from palpate.applications.touch.surface import ContactSurface
from palpate.core.arrays import FloatArray, IntArray

_STEPS = 12
_SHORTEST = 0.1


@dataclass(frozen=True, eq=False)
class Patch:
    """rows : (r,) faces near the probe. nodes : (m,) of the surface, their corners. unknowns : (r, 9) into the 3 m
    degrees of freedom.

    compliance : (3 m, 3 m) mm/mN.
    """

    rows: IntArray
    nodes: IntArray
    unknowns: IntArray
    compliance: FloatArray

    @classmethod
    def of(cls, surface: ContactSurface, rows: IntArray, compliance: FloatArray) -> Patch:
        """compliance : (3 s, 3 s) of the whole surface."""
        nodes, local = np.unique(surface.local_faces[rows], return_inverse=True)
        unknowns = (3 * local.reshape(-1, 3)[:, :, None] + np.arange(3)).reshape(-1, 9)
        patch = cls(rows, nodes, unknowns, np.zeros((0, 0)))
        return cls(rows, nodes, unknowns, compliance[np.ix_(patch.dofs, patch.dofs)])

    @property
    def dofs(self) -> IntArray:
        """(3 m,) among the surface's."""
        return (3 * self.nodes[:, None] + np.arange(3)).ravel()

    def settle(
        self, contact: Contact, u: FloatArray, du: FloatArray, f: FloatArray, precision: float
    ) -> tuple[FloatArray, Blocks]:
        """Contact forces f (3 m,) mN with w = du - compliance f and f those of the contact at u + w; the contact there.

        u, du : (s, 3) mm, where the surface is and how far it would go without the probe. f : a first guess. precision
        : of w, mm. Newton's method, shortened where it overshoots.
        """
        wanted = du[self.nodes].ravel()
        w = wanted - self.compliance @ f
        trial = u.copy()
        blocks, f, H, gap = self._at(contact, u, w, wanted, trial)
        for _ in range(_STEPS):
            size = float(np.abs(gap).max())
            if size < precision:
                break
            change = self._newton(H, gap)
            length = 1.0
            while True:
                trial_contact = self._at(contact, u, w + length * change, wanted, trial)
                if float(np.abs(trial_contact[3]).max()) < size or length < _SHORTEST:
                    break
                length *= 0.5
            w = w + length * change
            blocks, f, H, gap = trial_contact
        return f, blocks

    def _at(
        self, contact: Contact, u: FloatArray, w: FloatArray, wanted: FloatArray, trial: FloatArray
    ) -> tuple[Blocks, FloatArray, FloatArray, FloatArray]:
        trial[self.nodes] = u[self.nodes] + w.reshape(-1, 3)
        blocks = contact.blocks(self.rows, trial, 2)
        f, H = np.zeros(len(w)), np.zeros((len(w), len(w)))
        _gather(blocks.gradient, blocks.hessian, self.unknowns, f, H)
        return blocks, f, H, w + self.compliance @ f - wanted

    def _newton(self, H: FloatArray, gap: FloatArray) -> FloatArray:
        """-(I + compliance H)^-1 gap, by the degrees of freedom that H touches: the others follow."""
        touched = np.flatnonzero(H.diagonal())
        if not len(touched):
            return -gap
        stiff = H[np.ix_(touched, touched)]
        towards = self.compliance[:, touched] @ stiff
        inner = np.linalg.solve(np.eye(len(touched)) + towards[touched], -gap[touched])
        return -gap - towards @ inner


@njit(cache=True)
def _gather(gradient: FloatArray, hessian: FloatArray, unknowns: IntArray, f: FloatArray, H: FloatArray) -> None:
    for r in range(unknowns.shape[0]):
        for a in range(unknowns.shape[1]):
            if gradient[r, a] != 0.0 or hessian[r, a, a] != 0.0:
                f[unknowns[r, a]] += gradient[r, a]
                for b in range(unknowns.shape[1]):
                    H[unknowns[r, a], unknowns[r, b]] += hessian[r, a, b]
