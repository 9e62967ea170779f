"""Options of the segment step."""

from __future__ import annotations

from dataclasses import dataclass, field

from palpate.segmentation.prompts import Prompts


@dataclass(frozen=True)
class SegmentOptions:
    """How to segment.

    prompts : what a person pointed at in the scan at rest, LPS mm. prompts_deformed : in the deformed scan's own
    coordinates. margin_mm : tissue that is modelled around the prostate, along x, y, z. model : a learned model that is
    installed, for what nobody drew or pointed at.
    """

    prompts: Prompts = field(default_factory=Prompts)
    prompts_deformed: Prompts = field(default_factory=Prompts)
    margin_mm: tuple[float, float, float] = (36.0, 52.0, 62.0)
    model: str | None = None

    def to_dict(self) -> dict[str, object]:
        """JSON-able form, for the hash of the step's inputs."""
        return {
            "prompts": self.prompts.to_dict(),
            "prompts_deformed": self.prompts_deformed.to_dict(),
            "margin_mm": list(self.margin_mm),
            "model": self.model,
        }
