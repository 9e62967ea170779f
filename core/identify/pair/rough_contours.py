"""Pairs whose contours of the organ are too rough to tell a stiffness, by the errors that the contours state.

Errors that go together over the organ's size read as a strain of sd / R, R the radius of a ball of its volume. The strain of
an inclusion changes by at most 0.77 of itself as its stiffness changes e-fold (Eshelby, stiffness ratio 5), and pairs that
tell well strain the organ by about 0.15. At an error of 0.1 the standard deviation of ln G is then at least 0.1 / 0.15 / 0.77
= 0.9, a factor of 5.5 to both sides at 95 %, most of what is allowed; and the model, which is meshed from the contours, is
the body of another shape: its linearised errors no longer hold.
"""

from __future__ import annotations

import numpy as np

from palpate.core.identify.pair.no_information import NoInformation, moved_as_a_whole
from palpate.core.identify.pair.rigid_pair import RigidPair
from palpate.core.problem import IdentificationProblem, SurfacePair

# Largest strain that errors of the organ's contours may look like, see above.
MOST_STRAIN = 0.1


def strain_of_errors(organ: SurfacePair) -> float:
    """What the errors of an organ's two contours look like as a strain; 0 where they state none."""
    if organ.rest.sd_mm is None or organ.deformed.sd_mm is None:
        return 0.0
    r, d = (float(np.sqrt((s.sd_mm**2).mean())) for s in (organ.rest, organ.deformed) if s.sd_mm is not None)
    apart = np.sqrt(r**2 + d**2 - 2.0 * organ.common_share * r * d)
    radius = np.cbrt(3.0 * abs(organ.rest.enclosed_volume) / (4.0 * np.pi))
    return float(apart / radius)


def too_rough(organ: SurfacePair) -> str:
    """Why the contours tell nothing, in one line; empty where they may."""
    strain = strain_of_errors(organ)
    if strain <= MOST_STRAIN:
        return ""
    each = [float(np.sqrt((s.sd_mm**2).mean())) for s in (organ.rest, organ.deformed) if s.sd_mm is not None]
    return (
        f"the prostate's contours may be off by {' and '.join(f'{mm:.1f}' for mm in each)} mm (rms, at rest and deformed, estimated "
        f"from the images), which looks like a strain of {100.0 * strain:.0f} %, where a good pair has 15 %"
    )


def contours_tell_nothing(problem: IdentificationProblem, pair: RigidPair) -> NoInformation | None:
    """Reason and rigid motion of a pair whose contours are too rough; None for any other."""
    reason = too_rough(problem.organ)
    return None if not reason else moved_as_a_whole(problem, pair, reason)
