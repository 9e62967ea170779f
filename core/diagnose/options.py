"""All numbers that a diagnosis hangs on, as one value: passed down from `diagnose`, written into diagnosis.json."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from pathlib import Path

import msgspec

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.errors import InputError
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.sourced_number import Row, rows


@dataclass(frozen=True, kw_only=True)
class DiagnosisOptions:
    """Each with its unit and source, see there; the site's page of numbers lists them."""

    noise_model: NoiseModelOptions = field(default_factory=NoiseModelOptions)
    wall_motion: WallMotionOptions = field(default_factory=WallMotionOptions)
    decision_rules: DecisionRules = field(default_factory=DecisionRules)

    def to_json(self) -> dict[str, object]:
        """As JSON holds it; `from_json` is the inverse."""
        out: dict[str, object] = msgspec.json.decode(msgspec.json.encode(self))
        return out

    @classmethod
    def from_json(cls, values: object) -> DiagnosisOptions:
        """Numbers that are not given are the program's own. Raises InputError when values are not of this form."""
        try:
            return msgspec.convert(values, cls)
        except msgspec.ValidationError as error:
            raise InputError(f"the diagnosis's numbers are not readable ({error}); run diagnose again") from error

    def tables(self) -> dict[type, list[Row]]:
        """Of each option type its numbers."""
        parts = [getattr(self, f.name) for f in fields(self)]
        return {type(part): rows(part) for part in parts}


class DiagnosisJob(msgspec.Struct, frozen=True):
    """Options of a diagnosis as a job. case : its name. fit : file of the plain fit that `identify` keeps.

    effects : folder of a user's own effects.
    """

    case: str
    fit: str | None = None
    effects: str | None = None
    numbers: DiagnosisOptions = msgspec.field(default_factory=DiagnosisOptions)

    @property
    def folder(self) -> Path | None:
        """That of the effects."""
        return None if self.effects is None else Path(self.effects)
