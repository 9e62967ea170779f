"""Local deviation of ln G from its half's value, given data: a Gaussian field whose size and length the data choose.

The model of weighted data is r(theta, d) = r + J (theta - theta_0) + S d + e, e of unit variance; J = S B, for a half is the
sum of its patches. Given a size for each half and a length, d is normal with a Matern 3/2 kernel, conditioned on a
volume average of zero in each half. Their weights are prior times restricted likelihood: theta is
projected out. Given them and theta, d is normal; theta has the posterior of the plain fit. So the volume average of ln G
over a half has the mean and the covariance of that posterior, whatever the data say of d.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist
from scipy.special import softmax

from palpate.core.arrays import FloatArray
from palpate.core.identify.map.patches import Patches
from palpate.core.observe.contour_noise import matern_3_2

# Standard deviations of ln G within a half that are compared: none, and two in three places within a factor of the root
# of two, of two, of four. The last is what `--uneven` assumes (`core.identify.uneven_regions`).
SIZES = (0.0, 0.5 * float(np.log(2.0)), float(np.log(2.0)), float(np.log(4.0)))
# Correlation lengths, mm: a small focus, a large one, a trend over the half.
LENGTHS_MM = (6.0, 12.0, 24.0)
# Prior probability that neither half has a deviation; the rest is even over all others. As likely as not: a chosen prior.
NONE_ANYWHERE = 0.5
# Weights below this, over the largest, are left out of draws: a truncation.
_NEGLIGIBLE = 1e-5


@dataclass(frozen=True)
class Candidate:
    """One size of each region's deviation, ln G, and one length, mm. prior : its probability."""

    sizes: tuple[float, ...]
    length_mm: float
    prior: float

    @property
    def none(self) -> bool:
        """Whether no region has a deviation."""
        return not any(self.sizes)


def candidates(regions: int) -> tuple[Candidate, ...]:
    """All that are compared, for so many regions, the one without a deviation first."""
    some = [(s, length) for s in product(SIZES, repeat=regions) if any(s) for length in LENGTHS_MM]
    each = (1.0 - NONE_ANYWHERE) / len(some)
    none = Candidate((0.0,) * regions, LENGTHS_MM[0], NONE_ANYWHERE)
    return (none, *(Candidate(s, length, each) for s, length in some))


@dataclass(frozen=True, eq=False)
class Regional:
    """Posterior of the regions' ln G: mean (t,), covariance (t, t)."""

    mean: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, eq=False)
class _Given:
    """What follows from one candidate. gain (n, q) : takes reduced data to minus the mean. covariance (n, n) of the
    deviation, cross (t, n) with theta. prior (n,) : variances. projected (q, q), log_volume : of the restricted likelihood."""

    gain: FloatArray
    covariance: FloatArray
    cross: FloatArray
    prior: FloatArray
    projected: FloatArray
    log_volume: float


@dataclass(frozen=True, eq=False)
class LocalPosterior:
    """Posterior of the deviation. weights (h,) of the candidates. means (h, n) of each. mean (n,), covariance (n, n) of the
    mixture, cross (t, n) with the regions' ln G."""

    model: LocalField
    weights: FloatArray
    means: FloatArray

    @property
    def mean(self) -> FloatArray:
        """(n,) mean of the deviation."""
        return np.asarray(self.weights @ self.means, dtype=np.float64)

    @property
    def covariance(self) -> FloatArray:
        """(n, n) of the deviation: within the candidates and between them."""
        within = np.einsum("h,hij->ij", self.weights, np.stack([g.covariance for g in self.model.given]))
        off = self.means - self.mean
        return np.asarray(within + (self.weights[:, None] * off).T @ off, dtype=np.float64)

    @property
    def cross(self) -> FloatArray:
        """(t, n) covariance of the regions' ln G and the deviation."""
        return np.einsum("h,hti->ti", self.weights, np.stack([g.cross for g in self.model.given]))

    @property
    def uniform(self) -> FloatArray:
        """(t,) probability that a region has no deviation."""
        none = np.array([[s == 0.0 for s in c.sizes] for c in self.model.candidates])
        return np.asarray(self.weights @ none, dtype=np.float64)

    @property
    def length_mm(self) -> float:
        """Mean length of the field's candidates that have a deviation."""
        some = np.array([not c.none for c in self.model.candidates])
        return float(np.average([c.length_mm for c in self.model.candidates], weights=self.weights * some + 1e-300))

    def draws(self, count: int, rng: np.random.Generator) -> FloatArray:
        """(count, n) deviations; exactly 0 in a region that is drawn without one."""
        kept = np.where(self.weights > _NEGLIGIBLE * self.weights.max(), self.weights, 0.0)
        out = []
        for h, k in enumerate(rng.multinomial(count, kept / kept.sum())):
            values, vectors = np.linalg.eigh(self.model.given[h].covariance) if k else (np.zeros(0), np.zeros((0, 0)))
            if k:
                root = vectors * np.sqrt(np.maximum(values, 0.0))
                there = self.model.given[h].prior > 0.0
                out.append((self.means[h] + rng.standard_normal((k, len(values))) @ root.T) * there)
        return np.vstack(out)


class LocalField:
    """The deviation on patches, for one linearisation. sensitivities (n_data, n) : weighted. Data are reduced to the space
    that the sensitivities span, the rest of them says nothing of any stiffness."""

    def __init__(
        self, patches: Patches, sensitivities: FloatArray, regional: Regional, among: Sequence[Candidate] = ()
    ) -> None:
        self.patches, self.regional = patches, regional
        self.candidates = tuple(among) or candidates(len(patches.regions))
        self.onto, self.reduced = np.linalg.qr(sensitivities)
        self.given = [self._given(c) for c in self.candidates]

    def posterior(self, residual: FloatArray) -> LocalPosterior:
        """Posterior for a weighted residual (n_data,) at the regional means without a deviation."""
        y = self.onto.T @ residual
        logs = [
            np.log(c.prior) - 0.5 * (g.log_volume + float(y @ g.projected @ y))
            for c, g in zip(self.candidates, self.given, strict=True)
        ]
        means = np.stack([-g.gain @ y for g in self.given])
        return LocalPosterior(self, np.asarray(softmax(np.array(logs))), means)

    @property
    def added(self) -> FloatArray:
        """(n,) share of the deviation's variance, were there one, that the data take away, 0 to 1: what they add to the
        prior."""
        prior = np.array([c.prior * (not c.none) for c in self.candidates])
        before, left = (
            prior @ np.stack(each) for each in zip(*((g.prior, np.diag(g.covariance)) for g in self.given), strict=True)
        )
        return np.clip(1.0 - left / np.where(before > 0.0, before, np.inf), 0.0, 1.0) * (before > 0.0)

    @property
    def resolution(self) -> FloatArray:
        """(n, n) of which places a value averages the deviation, were there one: derivative of the mean in the truth."""
        prior = np.array([c.prior * (not c.none) for c in self.candidates])
        return np.asarray(
            np.einsum("h,hiq->iq", prior / prior.sum(), np.stack([g.gain for g in self.given])) @ self.reduced
        )

    def prior_covariance(self, candidate: Candidate) -> FloatArray:
        """(n, n) of the deviation: independent between regions, with a volume average of 0 in each."""
        out = np.zeros((self.patches.n, self.patches.n))
        for region, average, size in zip(self.patches.regions, self.patches.averages, candidate.sizes, strict=True):
            mine = np.flatnonzero(self.patches.region == region)
            centres, a = self.patches.centres[mine], average[mine]
            kernel = matern_3_2(cdist(centres, centres), candidate.length_mm)
            share = kernel @ a
            out[np.ix_(mine, mine)] = size**2 * (kernel - np.outer(share, share) / (a @ share))
        return out

    def _given(self, candidate: Candidate) -> _Given:
        K, R = self.prior_covariance(candidate), self.reduced
        J = R @ self.patches.members
        C = np.eye(len(R)) + R @ K @ R.T
        factor = cho_factor(C, lower=True)
        of_theta = cho_solve(factor, J)
        H = J.T @ of_theta
        projected = cho_solve(factor, np.eye(len(R))) - of_theta @ np.linalg.solve(H, of_theta.T)
        log_volume = 2.0 * float(np.log(np.diag(factor[0])).sum()) + float(np.linalg.slogdet(H)[1])
        gain = cho_solve(factor, R @ K).T
        by_theta = gain @ J
        covariance = K - gain @ R @ K + by_theta @ self.regional.covariance @ by_theta.T
        return _Given(
            gain, covariance, -self.regional.covariance @ by_theta.T, np.diag(K).copy(), projected, log_volume
        )
