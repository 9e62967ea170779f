"""Pairs of scans without information on stiffness: rigid motion, organ surface alone, no driving wall."""
