"""Regions that a person measured on the map, in the report."""
