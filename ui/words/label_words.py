"""How a label came about, in words: the same on the console and in the report."""

from __future__ import annotations

from collections.abc import Mapping

CARRIED = "found near its place at rest"
PROPAGATED = "carried over from the other scan"
# By the method that segmentation.json names.
WORDS: Mapping[str, str] = {
    "auto": "found automatically", "propagated": PROPAGATED,
    "carried": CARRIED, "user": "drawn by hand", "corrected": "found automatically, corrected by hand", "click": "from a click",
    "extremes": "from six points", "box": "from a box", "threshold": "dense in the CT",
    "threshold and user": "drawn by hand, and dense in the CT",
}  # fmt: skip
