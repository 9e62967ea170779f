"""Mechanics and inference on arrays: numpy, scipy, numba and a sparse solver; no image, case file or toolkit.

The method is S. Yang and M. C. Lin, "MaterialCloning: Acquiring Elasticity Parameters from Images for Medical
Applications", IEEE Transactions on Visualization and Computer Graphics. "Eq 8", "the paper" and "Yang & Lin" mean that.
docs/method.md has the equations, docs/references.bib the other sources.
"""
