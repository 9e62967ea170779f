"""The prostate on CT, and its halves."""
