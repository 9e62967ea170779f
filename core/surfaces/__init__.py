"""Geometry of triangle surfaces: closest points, distance fields, splines over points."""
