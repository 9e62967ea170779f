"""Scans, contours and surfaces: read, write, register."""
