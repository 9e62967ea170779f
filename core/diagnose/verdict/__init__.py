"""From refits to a verdict: judgement, shrinkage, averaged stiffness, record."""
