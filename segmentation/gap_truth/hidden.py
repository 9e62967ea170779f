"""What the blind check hides: twelve effects of the library and six beside it, each a change of a simulated body."""

from __future__ import annotations

from palpate.segmentation.gap_truth.hidden_library import LIBRARY
from palpate.segmentation.gap_truth.hidden_outside import OUTSIDE

__all__ = ["LIBRARY", "OUTSIDE", "SIZES"]

# Strength of each from weak to strong: about one to ten times the contours' noise where surfaces show it at all.
SIZES: dict[str, tuple[float, float]] = {
    "interface_sliding": (8.0, 80.0), "inclusion": (4.0, 25.0), "fibre_anisotropy": (2.0, 8.0), "volume_change": (0.06, 0.25),
    "compressible_organ": (0.15, 0.6), "tissue_stiffening": (5.0, 40.0), "tissue_heterogeneity": (3.0, 12.0),
    "bone_motion": (1.0, 5.0), "gravity_change": (1.0, 2.0), "prestress": (0.25, 0.7), "unmodelled_load": (4.0, 20.0),
    "contour_bias": (0.4, 1.8), "uneven_growth": (0.1, 0.35), "two_foci": (6.0, 30.0), "tissue_tear": (10.0, 50.0),
    "shrunken_tissue": (0.08, 0.25), "tissue_fibres": (2.0, 8.0), "one_sided_contour": (1.0, 3.5),
}  # fmt: skip
