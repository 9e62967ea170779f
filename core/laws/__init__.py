"""Strain-energy laws by name. A new law is a new file that defines a `Law`, and a line here."""

from palpate.core.laws.base import Law, PointValues
from palpate.core.laws.linear import LINEAR, bulk_modulus
from palpate.core.laws.mooney_rivlin import MOONEY_RIVLIN, MOONEY_RIVLIN_PRINTED, mooney_rivlin_parameters
from palpate.core.laws.neo_hookean import NEO_HOOKEAN
from palpate.core.laws.st_venant_kirchhoff import ST_VENANT_KIRCHHOFF

LAWS = {law.name: law for law in (MOONEY_RIVLIN, MOONEY_RIVLIN_PRINTED, NEO_HOOKEAN, LINEAR, ST_VENANT_KIRCHHOFF)}

__all__ = [
    "LAWS",
    "LINEAR",
    "MOONEY_RIVLIN",
    "MOONEY_RIVLIN_PRINTED",
    "NEO_HOOKEAN",
    "ST_VENANT_KIRCHHOFF",
    "Law",
    "PointValues",
    "bulk_modulus",
    "mooney_rivlin_parameters",
]
