"""The door for Python: arrays and meshes in, findings out."""
