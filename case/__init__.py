"""One patient's folder."""
