"""How the plain model of a case is fitted: the choices of a person that decide its stiffness."""

from __future__ import annotations

from dataclasses import dataclass

# Element that finds the fit, and the one that it is corrected by unless another is chosen.
QUICK, GOOD = "p1p1", "p2p1"
# Number of the inference's form: results of another one are out of date.
INFERENCE = 10


@dataclass(frozen=True, kw_only=True)
class FitOptions:
    """boundary : "coupled" or "contact-force". element : the fit's residual is this element's. starts : of Gauss-Newton.

    split_mu : look for mu1 and mu2 of every region apart (`StiffnessParameters`).
    """

    boundary: str = "coupled"
    element: str = GOOD
    starts: int = 3
    split_mu: bool = False
