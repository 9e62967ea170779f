"""Contours and label volumes of other programs, one format a file."""
