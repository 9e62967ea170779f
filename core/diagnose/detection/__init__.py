"""Is there a gap, and where: score test, gap test, placebo effects, patches left out, maps."""
