"""Plane drawings: SVG and PNG."""
