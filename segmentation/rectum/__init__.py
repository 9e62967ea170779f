"""The rectum on CT."""
