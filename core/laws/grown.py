"""Growth: a law whose strain is measured from a grown state, F = Fe Fg with Fg = ratio^(1/3) I (Rodriguez et al. 1994).

Energy is counted per unit of grown volume: the constant factor would only rename the moduli.
"""

from __future__ import annotations

from palpate.core.arrays import FloatArray
from palpate.core.laws.base import Kernel, Law, PointValues


def grown(law: Law, ratio: float) -> Law:
    """The law after the volume without load has become `ratio` times what it was."""
    stretch = ratio ** (1.0 / 3.0)

    def kernel(F: FloatArray, p: FloatArray, out: PointValues, order: int) -> None:
        _, _, P, G, A, H = out
        law.kernel(F / stretch, p, out, order)
        if order >= 1:
            P /= stretch
            G /= stretch
        if order >= 2:
            A /= stretch**2
            H /= stretch**2

    name = f"{law.name}, volume times {ratio:.12g}"
    whole: Kernel = kernel
    return Law(name, law.parameters, whole, law.kappa_of, law.shear_modulus_of, law.needs_positive_jacobian)
