"""Runs the module's self test in Slicer: `Slicer --testing --python-script PalpateStiffnessSelfTest.py`."""

from __future__ import annotations

import unittest

import slicer


class PalpateStiffnessSelfTest(unittest.TestCase):
    """The test class of the module, as CTest wants it."""

    def test_module(self) -> None:
        """The module loads and its self test passes."""
        slicer.util.selectModule("PalpateStiffness")
        slicer.modules.PalpateStiffnessWidget.runTest()


if __name__ == "__main__":
    unittest.main()
