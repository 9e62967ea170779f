"""The steps on a case folder: each reads it, calls one room, writes it."""
