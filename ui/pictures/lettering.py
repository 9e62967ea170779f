"""Letters in the report's pictures: at least nine points on paper, also where a picture is made smaller to end its page."""

from __future__ import annotations

# Width of a picture as wide as the report's page (A4 less 17 mm on both sides), inches: drawn so wide, a point is a point on paper.
PAGE_INCHES = 6.93
# A picture is made smaller to this share at most, rather than leave the rest of a page empty.
SMALLEST = 0.8
LEAST_POINTS = 9.0
TEXT = LEAST_POINTS / SMALLEST
