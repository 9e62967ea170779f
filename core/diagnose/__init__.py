"""Diagnosis of the sim-to-real gap: whether there is one, where, which effect causes it, and how far it shrinks."""
