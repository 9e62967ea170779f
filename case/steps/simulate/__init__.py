"""Simulate: a case folder whose stiffness is known, answers apart."""
