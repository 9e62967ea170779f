"""What the window of `palpate touch` knows: the organ's surface as it is now, what the probe feels, and the curve. Knows no toolkit."""

from __future__ import annotations

import base64
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from palpate.applications.touch.body import SUPPORTS, Body
from palpate.applications.touch.body_file import save_body
from palpate.applications.touch.window.protocol import Felt, Saved
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.ui.desktop.solid.process_pipe import Pipe, Reply
from palpate.ui.pictures.colours import StiffnessScale

_CHILD, _DRAWING = "palpate.applications.touch.window.child", "palpate.applications.touch.window.drawing"
# Longest wait of a script for one answer: making the organ ready may have to compile.
_SECONDS = 120.0
_RATE_OVER_S = 1.0


@dataclass(eq=False)
class TouchModel:
    """folder : for what passes between the processes. process : lets the window's events be handled for so many seconds. scale :
    colours of the stiffness.

    facts : of the probe. u : (s, 3) mm. curve : [touch, region, indentation_mm, force_n]. said : what went wrong last. ready : whether
    the probe can be used.
    """

    body: Body
    radius: float
    folder: Path
    process: Callable[[float], None]
    scale: StiffnessScale
    facts_now: Felt | None = None
    curve: list[tuple[int, str, float, float]] = field(default_factory=list)
    said: str = ""
    ready: bool = False
    changed: bool = True

    def __post_init__(self) -> None:
        surface = self.body.surface
        self.rest, self.faces = surface.rest, surface.local_faces
        self.u = np.zeros_like(self.rest)
        self._sent = self._answered = 0
        self._refused: dict[int, str] = {}
        self._files: list[str] = []
        self._times: deque[float] = deque(maxlen=400)
        save_body(self.folder / "body.npz", self.body)
        colours = {region: [round(255 * c) for c in self.scale.rgb(G)] for region, G in self.body.shear_kpa.items()}
        rgb = np.array([colours[int(r)] for r in self.body.mesh.regions[surface.owner]])
        np.savez(self.folder / "surface.npz", points=self.rest, faces=self.faces, rgb=rgb)
        self._probe = Pipe(_CHILD, self.folder / "probe.log")
        self.drawing = Pipe(_DRAWING, self.folder / "drawing.log")
        self.drawing.say(type="body", file=str(self.folder / "surface.npz"))
        self.ask("body", file=str(self.folder / "body.npz"), radius=self.radius)

    @property
    def answers_per_second(self) -> int:
        """Answers of the last second."""
        now = time.monotonic()
        return sum(now - t < _RATE_OVER_S for t in self._times)

    @property
    def held(self) -> str:
        """What holds the organ, in words."""
        return SUPPORTS[self.body.support]

    @property
    def busy(self) -> bool:
        """Whether an answer is still to come."""
        return self._answered < self._sent and not self._probe.over

    def ask(self, kind: str, **what: object) -> int:
        """Sends a message to the probe and returns its number."""
        self._sent += 1
        self._probe.say(type=kind, id=self._sent, **what)
        return self._sent

    def tick(self) -> None:
        """Takes what has come."""
        for reply in self._probe.replies():
            self._take(reply)
        if self._probe.over and not self.said:
            self.said, self.changed = (
                "the process that answers the probe has ended; close this window and open it again",
                True,
            )

    def position(self) -> tuple[list[float], bool] | None:
        """Where the probe is, [x, y, z, radius] mm, and whether it grips; None before a touch."""
        felt = self.facts_now
        if felt is None or not felt["region"]:
            return None
        point, normal = np.array(felt["point"]), np.array(felt["normal"])
        depth, radius = float(felt["indentation_mm"]), float(felt["probe_radius_mm"])
        return [*(point + (radius - depth) * normal).tolist(), radius], depth < 0.0

    def packed_u(self) -> str:
        """Displacements for the drawing process."""
        return base64.b64encode(self.u.astype(np.float32).tobytes()).decode()

    def close(self) -> None:
        """Ends both processes."""
        self._probe.close()
        self.drawing.close()

    # As `ProbeControl`, for scripts: each waits for its answer.

    def touch(self, point: FloatArray) -> Felt:
        """See `ProbeControl.touch`."""
        return self._wait(self.ask("touch", point=list(map(float, point))))

    def press(self, depth: float) -> Felt:
        """See `ProbeControl.press`."""
        return self._wait(self.ask("press", depth=float(depth)))

    def slide(self, point: FloatArray) -> Felt:
        """See `ProbeControl.slide`."""
        return self._wait(self.ask("slide", point=list(map(float, point))))

    def resize(self, radius: float) -> Felt:
        """See `ProbeControl.resize`."""
        return self._wait(self.ask("radius", mm=float(radius)))

    def forget(self) -> Felt:
        """See `ProbeControl.forget`."""
        return self._wait(self.ask("forget"))

    def save(self, path: Path) -> Saved:
        """See `ProbeControl.save`."""
        return {**self._wait(self.ask("save", path=str(path))), "files": self._files}

    def facts(self) -> Felt:
        """See `ProbeControl.facts`; all that was asked is answered first."""
        return {**self._wait(self._sent), "answers_per_second": self.answers_per_second}

    def _wait(self, number: int) -> Felt:
        end = time.monotonic() + _SECONDS
        while self._answered < number:
            if self._probe.over or time.monotonic() > end:
                raise InputError(self.said or f"the probe did not answer within {_SECONDS:g} s")
            self.process(0.002)
            self.tick()
        if number in self._refused:
            raise InputError(self._refused[number])
        assert self.facts_now is not None  # an answer has come
        return self.facts_now

    def _take(self, reply: Reply) -> None:
        head = reply.head
        self._answered, self.changed = max(self._answered, head["id"]), True
        if head["type"] == "refused":
            self.said = self._refused[head["id"]] = head["reason"]
            return
        self._files = head["facts"].pop("files", [])
        felt: Felt = head["facts"]
        self.facts_now, self.ready, self.said = felt, True, felt.get("said", "")
        if head["type"] == "ready":
            return
        self._times.append(time.monotonic())
        self.u = np.frombuffer(reply.data, dtype=np.float32).reshape(-1, 3).astype(float)
        if felt["answers"] == 0:
            self.curve.clear()
        self.curve += [tuple(row) for row in head["rows"]]
