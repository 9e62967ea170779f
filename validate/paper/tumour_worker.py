"""Full solves of the studies' scene in worker processes."""

from __future__ import annotations

from dataclasses import dataclass

from palpate.core.arrays import FloatArray
from palpate.core.reduced.greedy_design import Snapshot
from palpate.core.surfaces.surface import Surface
from palpate.validate.paper.tumour_fit import TumourFit
from palpate.validate.paper.tumour_scene import Divisions, DrivenScene, halved_ball, organ_volume


@dataclass(frozen=True, eq=False)
class Spec:
    """What a process needs to make the scene: see `TumourFit`."""

    rest: Surface
    divisions: Divisions
    element: str
    data: Divisions

    def scene(self) -> DrivenScene:
        """The scene alone."""
        return DrivenScene(halved_ball(self.divisions, organ_volume(halved_ball(self.data))), self.element)


_FIT: TumourFit | None = None


def initialise(spec: Spec) -> None:
    """Run once in every worker process."""
    global _FIT
    _FIT = TumourFit.without_model(spec.rest, spec.divisions, spec.element, spec.data)


def snapshot(theta: FloatArray) -> Snapshot | None:
    """A full solve in a process that was initialised."""
    if _FIT is None:
        raise RuntimeError("tumour_worker.initialise was not run in this process")
    return _FIT.solve(theta)[0]
