"""The process that answers the probe for the window of `palpate touch`: ``python -m palpate.applications.touch.window.child``.

| type | further keys | answer |
| --- | --- | --- |
| body | file (see `palpate.applications.touch.body_file`), radius | ready |
| touch, slide | point | felt |
| at | point, depth: slides there at once | felt; of several that wait together only the last is answered |
| press | depth: in small steps | felt |
| radius | mm | felt |
| forget | | felt |
| save | path | felt, with `files` |

felt: {"id", "facts", "rows": new [touch, region, indentation_mm, force_n] of the curve}, then the surface's displacement, (s, 3) float32,
mm. What cannot be done is answered by {"type": "refused", "id", "reason"}.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from palpate.applications.touch.body_file import load_body
from palpate.applications.touch.window.protocol import Felt, ProbeControl
from palpate.core.errors import InputError
from palpate.ui.desktop.solid.pipe_child import Answer, Message, serve


class Child:
    """Messages to a probe, and what it feels back."""

    def __init__(self) -> None:
        self._probe: ProbeControl | None = None
        self._told = 0

    def handle(self, messages: list[Message], answer: Answer) -> None:
        """Does what the messages ask; of places of the mouse only the last counts."""
        for k, message in enumerate(messages):
            later = messages[k + 1 : k + 2]
            if message["type"] == "at" and later and later[0]["type"] == "at":
                continue
            try:
                self._do(message, answer)
            except InputError as error:
                answer({"type": "refused", "id": message["id"], "reason": str(error)}, b"")

    def _do(self, message: Message, answer: Answer) -> None:
        if message["type"] == "body":
            self._probe = ProbeControl(load_body(Path(message["file"])), message["radius"])
            answer({"type": "ready", "id": message["id"], "facts": self._probe.facts()}, b"")
            return
        probe = self._probe
        assert probe is not None
        facts = self._ask(probe, message)
        new = [(row.touch, row.region, row.indentation_mm, row.force_n) for row in probe.rows[self._told :]]
        self._told = len(probe.rows)
        u = np.zeros((len(probe.session.body.surface.nodes), 3))
        if probe.answer is not None:
            u = probe.answer.u[probe.session.body.surface.nodes]
        head = {"type": "felt", "id": message["id"], "facts": facts, "rows": new}
        answer(head, np.ascontiguousarray(u, dtype=np.float32).tobytes())

    def _ask(self, probe: ProbeControl, message: Message) -> Felt:
        kind = message["type"]
        if kind == "touch":
            return probe.touch(np.array(message["point"]))
        if kind == "slide":
            return probe.slide(np.array(message["point"]))
        if kind == "at":
            probe.session.slide(np.array(message["point"]))
            return probe.go(message["depth"])
        if kind == "press":
            return probe.press(message["depth"])
        if kind == "radius":
            return probe.resize(message["mm"])
        if kind == "save":
            return probe.save(Path(message["path"]))
        self._told = 0
        return probe.forget()


if __name__ == "__main__":
    sys.exit(serve(Child().handle, gives_way=False))  # a hand waits for it
