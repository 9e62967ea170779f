"""Reduced models of one equilibrium: snapshots, hyper-reduction, interpolation, each with an error estimate."""
