"""Sides of a drawing on which its figure may be held."""

SIDES = ("bottom", "top", "left", "right")
