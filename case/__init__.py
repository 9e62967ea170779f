"""Folder of one patient (a case) and the steps that work on it."""
