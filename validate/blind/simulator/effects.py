"""What the blind check hides: twelve effects of the library and eight beside it, each a change of a simulated body."""

from __future__ import annotations

from palpate.validate.blind.simulator.library_effects import LIBRARY
from palpate.validate.blind.simulator.outside_effects import OUTSIDE

__all__ = ["LIBRARY", "OUTSIDE", "OWN_SHARE", "SIZES"]

# Strength of each, the weakest and the strongest that a pelvis may have. Between them the study looks for one that the surface shows
# as far as it wants; where even the strongest shows less, that is what the case has.
SIZES: dict[str, tuple[float, float]] = {
    "interface_sliding": (3.0, 150.0), "inclusion": (2.0, 40.0), "fibre_anisotropy": (0.5, 12.0), "volume_change": (0.02, 0.35),
    "compressible_organ": (0.05, 1.5), "tissue_stiffening": (2.0, 60.0), "tissue_heterogeneity": (1.5, 15.0),
    "bone_motion": (0.5, 8.0), "gravity_change": (0.2, 1.0), "prestress": (0.15, 0.9), "unmodelled_load": (3.0, 60.0),
    "contour_bias": (0.35, 3.0), "scan_stretched": (0.01, 0.15), "slices_shifted": (0.5, 8.0), "wall_drawn_wide": (0.5, 5.0),
    "catheter_pull": (0.02, 1.5), "organ_twist": (0.3, 15.0), "tissue_tear": (3.0, 60.0), "shrunken_tissue": (0.03, 0.3),
    "tissue_fibres": (0.5, 10.0),
}  # fmt: skip

# What happens between two scans, or in one alone: a further deformed state has its own share of the size, from none to all of it. What
# belongs to the body is in every state in full; prestress too, which is in the scan at rest that they share.
OWN_SHARE = frozenset(
    {
        "volume_change", "bone_motion", "gravity_change", "unmodelled_load", "contour_bias", "scan_stretched", "slices_shifted",
        "wall_drawn_wide", "catheter_pull", "organ_twist", "shrunken_tissue",
    }
)  # fmt: skip
