"""Simulated patients of several simulators without anything hidden, written with or without voxels and contour errors."""
