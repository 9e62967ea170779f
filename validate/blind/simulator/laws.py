"""Strain-energy laws of the blind check's simulator, written out anew from the paper: stress and tangent at many points at once.

Everything is an array over points p: F (p, 3, 3), first Piola-Kirchhoff stress P (p, 3, 3) kPa, tangent A = dP/dF (p, 3, 3, 3, 3).
Of a law's energy the part 1/2 k d^2 of the dilation d can be taken out (`Dilation`) and put back as a pressure that is the same all over a
cell: with a pressure of its own at every point a nearly incompressible quadratic cell is too stiff.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from palpate.core.arrays import FloatArray

_ONE = np.eye(3)
_LEVI_CIVITA = np.zeros((3, 3, 3))
_LEVI_CIVITA[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
_LEVI_CIVITA[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = -1.0
# d(A_iJ)/d(F_kL) of F itself, and the deviatoric projection of a symmetric tensor.
_FOURTH = np.einsum("ik,JL->iJkL", _ONE, _ONE)
_SYMMETRIC = 0.5 * (_FOURTH + np.einsum("iL,Jk->iJkL", _ONE, _ONE))
_DEVIATORIC = _SYMMETRIC - np.einsum("iJ,kL->iJkL", _ONE, _ONE) / 3.0


@dataclass(frozen=True, eq=False)
class Dilation:
    """d (p,), its derivative (p, 3, 3) in F, and modulus (p,) kPa: k of the energy 1/2 k d^2 per volume at rest."""

    value: FloatArray
    slope: FloatArray
    modulus: FloatArray


@dataclass(frozen=True, eq=False)
class _Law:
    """What both laws have, at points p."""

    G: FloatArray
    K: FloatArray
    growth: FloatArray
    fibre: FloatArray

    def eased(self, way: float) -> Self:
        """With so much of its growth, 0 to 1."""
        return replace(self, growth=self.growth**way)

    def softer(self, share: float) -> Self:
        """With so much of its bulk modulus."""
        return replace(self, K=share * self.K)


@dataclass(frozen=True, eq=False)
class Organ(_Law):
    """Mooney-Rivlin (paper Eq 8), mu1 = mu2 = G / 4, volumetric term v1 (J - 1)^2 with 2 v1 = K; all (p,) kPa.

    growth : (p,) linear stretch that costs nothing. fibre : (p,) kPa of 1/2 c (I4 - 1)^2 along `direction`.
    """

    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def dilation(self, F: FloatArray) -> Dilation:
        """J - 1 of the elastic part."""
        g3 = self.growth**3
        return Dilation(np.linalg.det(F) / g3 - 1.0, _by(1.0 / g3, _cofactor(F)), g3 * self.K)

    def response(self, F: FloatArray, pressure: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """P and A; not finite where the elastic volume ratio is not positive.

        pressure : (p,) kPa, constant, for what the law itself says.
        """
        g = self.growth[:, None, None]
        v1 = self.K / 2.0 if pressure is None else np.zeros_like(self.K)
        # Of the grown volume, as all that `_mooney_rivlin` is given.
        p = 0.0 if pressure is None else pressure / self.growth**3
        P, A = _mooney_rivlin(F / g, self.G / 4.0, self.G / 4.0, v1, p)
        if self.fibre.any():
            Pf, Af = _fibre(F / g, self.fibre, np.array(self.direction))
            P, A = P + Pf, A + Af
        return g**2 * P, g[..., None, None] * A


@dataclass(frozen=True, eq=False)
class Tissue(_Law):
    """Linear elastic in the small strain e (paper Eq 3); all (p,) kPa.

    stiffening : b of sigma = 2 G (1 + b dev e : dev e) dev e + K tr e. fibre : (p,) kPa, extra stress c (a.e a) a a. growth : (p,)
    linear stretch that costs nothing.
    """

    stiffening: float = 0.0
    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)

    @property
    def constant(self) -> bool:
        """Whether A is the same at any F, and whatever has grown."""
        return not self.stiffening and not self.fibre.any()

    def dilation(self, F: FloatArray) -> Dilation:
        """tr e."""
        trace = np.einsum("pii->p", F) - 3.0 * self.growth
        return Dilation(trace, np.broadcast_to(_ONE, F.shape), self.K)

    def stress(self, F: FloatArray, pressure: FloatArray) -> FloatArray:
        """P (p, 3, 3) kPa of a law whose A is constant, without A; F (p, 3, 3), pressure (p,) kPa."""
        e = 0.5 * (F + np.swapaxes(F, 1, 2)) - self.growth[:, None, None] * _ONE
        trace = np.einsum("pii->p", e)
        return (2.0 * self.G)[:, None, None] * e + (pressure - 2.0 / 3.0 * self.G * trace)[:, None, None] * _ONE

    def response(self, F: FloatArray, pressure: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """P and A. pressure : (p,) kPa, constant, for what the law itself says."""
        e = 0.5 * (F + np.swapaxes(F, 1, 2)) - self.growth[:, None, None] * _ONE
        trace = np.einsum("pii->p", e)
        dev = e - trace[:, None, None] / 3.0 * _ONE
        stiffer = 1.0 + self.stiffening * np.einsum("pij,pij->p", dev, dev)
        all_round = self.K * trace if pressure is None else pressure
        P = (2.0 * self.G * stiffer)[:, None, None] * dev + all_round[:, None, None] * _ONE
        A = (2.0 * self.G * stiffer)[:, None, None, None, None] * _DEVIATORIC
        if pressure is None:
            A = A + self.K[:, None, None, None, None] * np.einsum("iJ,kL->iJkL", _ONE, _ONE)
        if self.stiffening:
            A = A + 4.0 * self.stiffening * np.einsum("p,pij,pkl->pijkl", self.G, dev, dev)
        if self.fibre.any():
            aa = np.multiply.outer(np.array(self.direction), np.array(self.direction))
            along = np.einsum("pij,ij->p", e, aa)
            P = P + (self.fibre * along)[:, None, None] * aa
            A = A + self.fibre[:, None, None, None, None] * np.einsum("iJ,kL->iJkL", aa, aa)
        return P, A


def _cofactor(F: FloatArray) -> FloatArray:
    """(p, 3, 3) of F, also of one that has no inverse."""
    return np.asarray(0.5 * np.einsum("ikm,jln,pkl,pmn->pij", _LEVI_CIVITA, _LEVI_CIVITA, F, F, optimize=True))


def _mooney_rivlin(
    F: FloatArray, mu1: FloatArray, mu2: FloatArray, v1: FloatArray, pressure: FloatArray | float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """psi = mu1 (I2 J^-4/3 - 3) + mu2 (I1 J^-2/3 - 3) + v1 (J - 1)^2 + pressure J, I2 = (I1^2 - tr C^2) / 2."""
    J = np.linalg.det(F)
    J = np.where(J > 0.0, J, np.nan)
    C, B = np.einsum("pki,pkj->pij", F, F), np.einsum("pik,pjk->pij", F, F)
    I1 = np.einsum("pii->p", C)
    I2 = 0.5 * (I1**2 - np.einsum("pij,pij->p", C, C))
    cof = J[:, None, None] * np.swapaxes(np.linalg.inv(F), 1, 2)
    d1, d2 = 2.0 * F, 2.0 * (I1[:, None, None] * F - np.einsum("pik,pkj->pij", F, C))
    W1, W2 = mu2 * J ** (-2 / 3), mu1 * J ** (-4 / 3)
    WJ = -2 / 3 * W1 * I1 / J - 4 / 3 * W2 * I2 / J + 2.0 * v1 * (J - 1.0) + pressure
    W1J, W2J = -2 / 3 * W1 / J, -4 / 3 * W2 / J
    WJJ = 10 / 9 * W1 * I1 / J**2 + 28 / 9 * W2 * I2 / J**2 + 2.0 * v1
    P = _by(W1, d1) + _by(W2, d2) + _by(WJ, cof)
    H2 = 2.0 * (
        2.0 * np.einsum("pij,pkl->pijkl", F, F)
        + I1[:, None, None, None, None] * _FOURTH
        - np.einsum("ik,pjl->pijkl", _ONE, C)
        - np.einsum("pil,pkj->pijkl", F, F)
        - np.einsum("pik,jl->pijkl", B, _ONE)
    )
    HJ = np.einsum("ikm,jln,pmn->pijkl", _LEVI_CIVITA, _LEVI_CIVITA, F, optimize=True)
    mixed = _by(W1J, d1) + _by(W2J, d2)
    A = 2.0 * W1[:, None, None, None, None] * _FOURTH + W2[:, None, None, None, None] * H2
    A += WJ[:, None, None, None, None] * HJ + WJJ[:, None, None, None, None] * np.einsum("pij,pkl->pijkl", cof, cof)
    A += np.einsum("pij,pkl->pijkl", mixed, cof) + np.einsum("pij,pkl->pijkl", cof, mixed)
    return P, A


def _fibre(F: FloatArray, c: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray]:
    """psi = 1/2 c (I4 - 1)^2 with I4 = |F a|^2; an extra Young's modulus of 4 c along a at small strain."""
    Fa = F @ a
    stretch = np.einsum("pi,pi->p", Fa, Fa) - 1.0
    P = np.einsum("p,pi,j->pij", 2.0 * c * stretch, Fa, a)
    A = np.einsum("p,ik,j,l->pijkl", 2.0 * c * stretch, _ONE, a, a)
    return P, A + np.einsum("p,pi,j,pk,l->pijkl", 4.0 * c, Fa, a, Fa, a, optimize=True)


def _by(factor: FloatArray, tensor: FloatArray) -> FloatArray:
    return np.asarray(factor[:, None, None] * tensor)
