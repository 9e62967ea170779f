"""Identification of stiffness from two scans: optimum, particle swarm, posterior and stiffness map."""
