"""Pairs that need care: moved rigidly, surfaces alone, no wall that drives."""
