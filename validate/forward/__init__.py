"""Errors and seconds of elements and of the reduced model; random scenes."""
