"""Pictures of the studies, one a file."""
