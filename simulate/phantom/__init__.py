"""A made-up pelvis from solids."""
