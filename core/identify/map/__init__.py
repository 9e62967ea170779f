"""Smooth stiffness map within the organ."""
