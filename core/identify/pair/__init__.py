"""Pairs of scans that tell no stiffness: a motion as a whole, an organ whose surface is all that is seen."""
