"""Interface of a material law (Eqs 4 to 7 of Yang & Lin: stress from an energy of invariants and volume).

A law's energy density is written  psi(F) = W(F) + kappa/2 g(F)^2,  where W is the part without volume change and g a
volumetric measure (J - 1, tr eps, ...). A displacement-only element uses psi; a mixed element replaces the second term by
p g - p^2 / (2 kappa), so one law serves both. kPa throughout; F is (3, 3), index pairs (i, J) are flattened to 3 i + J.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError


class PointValues(NamedTuple):
    """A law evaluated at points: W, g (n, q); P = dW/dF, G = dg/dF (n, q, 3, 3); A, H second derivatives (n, q, 9, 9)."""

    W: FloatArray
    g: FloatArray
    P: FloatArray
    G: FloatArray
    A: FloatArray
    H: FloatArray


# kernel(F (n, q, 3, 3), p (n, k), out, order): fills W and g of `out`; with order >= 1 their first derivatives P and G; with order 2
# their second derivatives A and H.
Kernel = Callable[[FloatArray, FloatArray, PointValues, int], None]


@dataclass(frozen=True)
class Law:
    """A strain-energy law with its parameter names; values are passed per cell.

    name : the law's name in files and reports.
    parameters : names of the columns of a parameter array (n, k), kPa.
    kernel : see `Kernel`; W must be linear in the parameters (tests/core/fem/test_laws.py checks every law), g free of them.
    kappa_of : (n, k) parameters -> (n,) kappa, kPa; a linear function.
    shear_modulus_of : (n, k) -> (n,) small-strain shear modulus G, kPa; a linear function.
    needs_positive_jacobian : True when psi is not defined for J <= 0.
    """

    name: str
    parameters: tuple[str, ...]
    kernel: Kernel
    kappa_of: Callable[[FloatArray], FloatArray]
    shear_modulus_of: Callable[[FloatArray], FloatArray]
    needs_positive_jacobian: bool = True

    def evaluate(self, F: FloatArray, p: FloatArray, order: int = 2) -> PointValues:
        """Values at F (n, q, 3, 3) with parameters p (n, k); derivatives up to `order` (the others are empty arrays)."""
        n, q = F.shape[:2]
        first = (n, q, 3, 3) if order >= 1 else (0, 0, 3, 3)
        second = (n, q, 9, 9) if order >= 2 else (0, 0, 9, 9)
        out = PointValues(*(np.empty(s) for s in ((n, q), (n, q), first, first, second, second)))
        self.kernel(F, p, out, order)
        return out

    def energy(self, F: ArrayLike, p: ArrayLike) -> FloatArray:
        """psi (n,) kPa of deformation gradients F (n, 3, 3); p is (k,) or (n, k)."""
        F4, p2 = self._as_cells(F, p)
        v = self.evaluate(F4, p2, 0)
        return (v.W + 0.5 * self.kappa_of(p2)[:, None] * v.g**2)[:, 0]

    def stress(self, F: ArrayLike, p: ArrayLike) -> FloatArray:
        """First Piola-Kirchhoff stress dpsi/dF (n, 3, 3), kPa."""
        F4, p2 = self._as_cells(F, p)
        v = self.evaluate(F4, p2, 1)
        return (v.P + (self.kappa_of(p2)[:, None] * v.g)[..., None, None] * v.G)[:, 0]

    def tangent(self, F: ArrayLike, p: ArrayLike) -> FloatArray:
        """d2psi/dF dF (n, 9, 9), kPa."""
        F4, p2 = self._as_cells(F, p)
        v = self.evaluate(F4, p2, 2)
        G = v.G.reshape(*v.G.shape[:2], 9)
        kappa = self.kappa_of(p2)[:, None, None, None]
        return (v.A + kappa * (G[..., :, None] * G[..., None, :] + v.g[..., None, None] * v.H))[:, 0]

    def of_moduli(self, G: float, K: float) -> FloatArray:
        """The least parameters (k,), kPa, whose small-strain shear modulus is G and whose bulk modulus is K, both kPa.

        Parameters that count alike in G share it alike (mu1 = mu2), those that count in neither are 0. Raises InputError where the
        law has no such parameters.
        """
        rows = self._moduli
        gram = rows @ rows.T
        if not np.linalg.det(gram) > 1e-12 * np.trace(gram) ** 2:
            raise InputError(
                f"law '{self.name}' has no shear and bulk modulus of its own; choose another for the organ"
            )
        return np.asarray(rows.T @ np.linalg.solve(gram, [G, K]), dtype=np.float64)

    @cached_property
    def _moduli(self) -> FloatArray:
        """(2, k) derivatives of G and of the bulk modulus kappa g'(1)^2 in the parameters."""
        unit = np.eye(len(self.parameters))
        slope = self.evaluate(np.eye(3).reshape(1, 1, 3, 3), unit[:1], 1).G[0, 0, 0, 0]
        return np.stack([self.shear_modulus_of(unit), self.kappa_of(unit) * slope**2])

    def _as_cells(self, F: ArrayLike, p: ArrayLike) -> tuple[FloatArray, FloatArray]:
        F4 = np.ascontiguousarray(np.asarray(F, dtype=float).reshape(-1, 1, 3, 3))
        p2 = np.ascontiguousarray(np.broadcast_to(np.asarray(p, dtype=float), (len(F4), len(self.parameters))))
        return F4, p2


def shear_of_G_K(p: FloatArray) -> FloatArray:
    """G (n,) of parameters (n, k) whose first is G."""
    return p[:, 0].copy()


def bulk_of_G_K(p: FloatArray) -> FloatArray:
    """K (n,) of parameters (n, k) whose second is K: it is kappa."""
    return p[:, 1].copy()
