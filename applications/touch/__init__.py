"""A soft body touched by a rigid spherical probe: contact, the full equilibrium, and a quick answer that knows its own
error.
"""
