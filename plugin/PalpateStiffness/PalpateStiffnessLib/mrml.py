"""Names for the objects of Slicer's scene. Slicer ships no type stubs, so that a checker knows nothing of them."""

from __future__ import annotations

from typing import Any

MrmlScene = Any
"""vtkMRMLScene."""

MrmlNode = Any
"""A vtkMRMLNode of the class that the function names."""

MrmlDatabase = Any
"""ctkDICOMDatabase."""
