"""Trained models that a user has installed."""
