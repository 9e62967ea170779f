"""Panels of the window: widgets only."""
