"""Rigid alignment of two scans on bone."""
