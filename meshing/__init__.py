"""Labels to surfaces to one conforming mesh."""
