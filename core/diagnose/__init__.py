"""The sim-to-real gap: is there one, where, which effect that the model leaves out causes it, and how far it shrinks with it."""
