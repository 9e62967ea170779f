"""How long the window did not answer: a timer that should ring every few milliseconds, and the longest it was late."""

from __future__ import annotations

import time
from collections import deque

from PySide6.QtCore import QObject, Qt, QTimer

INTERVAL_MS = 5


class StallMeter(QObject):
    """longest_ms : the longest time between two rings beyond the interval, since `reset`."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.longest_ms = 0.0
        self.recent: deque[float] = deque(maxlen=2000)
        self._last = time.perf_counter()
        self._timer = QTimer(self)
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._ring)
        self._timer.start(INTERVAL_MS)

    def reset(self) -> None:
        """Starts anew."""
        self.longest_ms, self._last = 0.0, time.perf_counter()
        self.recent.clear()

    def _ring(self) -> None:
        now = time.perf_counter()
        late = 1000.0 * (now - self._last) - INTERVAL_MS
        self._last = now
        self.recent.append(late)
        self.longest_ms = max(self.longest_ms, late)
