"""Equilibrium by Newton steps: displacement alone, or displacement and pressure."""
