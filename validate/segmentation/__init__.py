"""Dice against drawn contours."""
