"""The 3D view: a child process that draws, and its client."""
