"""The bladder on CT."""
