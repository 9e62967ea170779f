"""Motion, contact and friction against closed forms."""
