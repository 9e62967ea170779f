"""Sparse factorisations by name, and the matrix structure that they share."""
