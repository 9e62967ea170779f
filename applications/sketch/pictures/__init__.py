"""Pictures and files of a sketch."""
