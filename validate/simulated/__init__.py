"""Simulated patients of several simulators without anything hidden: contour errors, fillings, moved bodies."""
