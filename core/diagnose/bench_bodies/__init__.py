"""Bodies on a bench: known supports and loads, several states, markers instead of contours."""
