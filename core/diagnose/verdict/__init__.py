"""Verdict from refits: judgement, shrinkage, averaged stiffness, record."""
