"""Searches and posteriors that know nothing of bodies: swarm, Gauss-Newton, Laplace, evidence, held-out prediction."""
