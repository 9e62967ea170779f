"""Options of the segment step."""

from __future__ import annotations

from dataclasses import dataclass, field

from palpate.segmentation.prompts import Prompts


@dataclass(frozen=True)
class SegmentOptions:
    """How to segment.

    prompts : what a person pointed at in the scan at rest, LPS mm. prompts_deformed : in the deformed scan's own
    coordinates. margin_mm : tissue that is modelled around the prostate, along x, y, z. model : a learned model that is
    installed, for what nobody drew or pointed at. propagate : carry organs that nobody drew or pointed at in one
    scan over from the other by the motion that both CTs show; without, or with a model, each scan is segmented by itself.
    """

    prompts: Prompts = field(default_factory=Prompts)
    prompts_deformed: Prompts = field(default_factory=Prompts)
    margin_mm: tuple[float, float, float] = (36.0, 52.0, 62.0)
    model: str | None = None
    propagate: bool = True

    def to_dict(self) -> dict[str, object]:
        """JSON-able form, for the hash of the step's inputs."""
        told: dict[str, object] = {
            "prompts": self.prompts.to_dict(),
            "prompts_deformed": self.prompts_deformed.to_dict(),
            "margin_mm": list(self.margin_mm),
            "model": self.model,
        }
        # Named only where it is not as usual: cases that were segmented before it was there stay up to date.
        return told if self.propagate else {**told, "propagate": False}
