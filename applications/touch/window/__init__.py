"""The window in which an organ is touched."""
