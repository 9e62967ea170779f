"""Reduced models of one equilibrium: greedy snapshots and kernel interpolation, with an error estimate. No
hyper-reduction.
"""
