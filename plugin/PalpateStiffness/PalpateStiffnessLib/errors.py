"""What a person can put right, said in the panel."""

from __future__ import annotations


class InputError(Exception):
    """What was asked for cannot be done; says what to do."""
