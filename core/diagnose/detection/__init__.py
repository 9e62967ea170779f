"""Detection and location of a gap: score test, gap test, placebo effects, patches left out, maps."""
