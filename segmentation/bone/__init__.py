"""Bones on CT: what is bone, its parts, their motion between scans, landmarks."""
