"""Film of an organ that falls."""
