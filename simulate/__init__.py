"""A body whose stiffness is known: phantom, wall motion, equilibrium, scanner."""
