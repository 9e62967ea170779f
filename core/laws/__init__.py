"""Strain-energy laws by name. A new law is a new file in this folder that defines a `Law`; nothing else changes."""

from __future__ import annotations

import importlib
import pkgutil

from palpate.core.laws.base import Law, PointValues
from palpate.core.laws.linear import LINEAR, bulk_modulus
from palpate.core.laws.mooney_rivlin import MOONEY_RIVLIN, MOONEY_RIVLIN_PRINTED, mooney_rivlin_parameters
from palpate.core.laws.neo_hookean import NEO_HOOKEAN


def _find_laws() -> dict[str, Law]:
    """Every `Law` that a module of this folder defines, by its name."""
    laws: dict[str, Law] = {}
    for module in sorted(m.name for m in pkgutil.iter_modules(__path__)):
        for value in vars(importlib.import_module(f"{__name__}.{module}")).values():
            if isinstance(value, Law) and laws.setdefault(value.name, value) is not value:
                raise ImportError(f"two laws are named '{value.name}'; the second is in {module}.py")
    return laws


LAWS = _find_laws()

__all__ = [
    "LAWS",
    "LINEAR",
    "MOONEY_RIVLIN",
    "MOONEY_RIVLIN_PRINTED",
    "NEO_HOOKEAN",
    "Law",
    "PointValues",
    "bulk_modulus",
    "mooney_rivlin_parameters",
]
