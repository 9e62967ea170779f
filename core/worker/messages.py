"""Messages of a worker process: one JSON object a line.

| type | further keys |
| --- | --- |
| started | kind, process |
| progress | fraction 0 to 1, message, and what the kind of job adds (best, iteration, particles, ...) |
| checkpoint | path, iteration |
| result | result: what the job's function returned |
| failed | reason: one line, exit_code |
| cancelled | |

The parent sends one message, {"type": "cancel"}.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from palpate.core.files.json_types import plain

Message = dict[str, Any]

TYPES = frozenset({"started", "progress", "checkpoint", "result", "failed", "cancelled", "cancel"})


class Reporter:
    """Reports of a job; `send` takes each message."""

    def __init__(self, send: Callable[[Message], None]) -> None:
        self._send = send

    def progress(self, fraction: float, message: str, **details: Any) -> None:
        """Fraction done and a short line; fits `palpate.core.worker.progress.Progress`."""
        self._send({"type": "progress", "fraction": min(max(float(fraction), 0.0), 1.0), "message": message, **details})

    def checkpoint(self, path: Path, iteration: int) -> None:
        """A checkpoint was written."""
        self._send({"type": "checkpoint", "path": path, "iteration": iteration})


def encode(message: Mapping[str, Any]) -> str:
    """One line without its end. Arrays become lists; a number that is not finite becomes null, as JSON knows none."""
    return json.dumps(_plain(message), allow_nan=False, ensure_ascii=True)


def decode(line: str | bytes) -> Message | None:
    """The message in a line; None when the line is no message (a library may print to the same stream)."""
    try:
        message = json.loads(line)
    except ValueError:
        return None
    return message if isinstance(message, dict) and message.get("type") in TYPES else None


def _plain(value: object) -> object:
    if isinstance(value, msgspec.Struct):
        return _plain(plain(value))
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value
