"""Palpate: tissue stiffness from two CT scans, with its uncertainty. Research use only.

The rooms are `palpate.core`, `palpate.imaging`, `palpate.segmentation`, `palpate.meshing`, `palpate.simulate`,
`palpate.case`, `palpate.validate` and `palpate.ui`. Importing this package loads none of them.
"""

__version__ = "0.1.0"
