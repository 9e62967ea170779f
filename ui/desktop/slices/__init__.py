"""Slice views and what they draw."""
