"""Data vector, covariance of its noise, linearisation: what both `identify` and `diagnose` weigh residuals with."""
