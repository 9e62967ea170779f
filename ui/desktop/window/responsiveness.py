"""How long the window did not answer: a timer that should ring every few milliseconds, and the longest it was late."""

from __future__ import annotations

import time

from PySide6.QtCore import QObject, Qt, QTimer

INTERVAL_MS = 5


class ResponsivenessMeter(QObject):
    """longest_ms : the longest time between two rings beyond the interval, since `reset`. longest_own_ms : the most processor
    time that the window's own thread took between two rings: what would be left of a stall on a machine with nothing else to do."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.longest_ms = self.longest_own_ms = 0.0
        self._last, self._own = time.perf_counter(), time.thread_time()
        self._timer = QTimer(self)
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._ring)
        self._timer.start(INTERVAL_MS)

    def reset(self) -> None:
        """Starts anew."""
        self.longest_ms = self.longest_own_ms = 0.0
        self._last, self._own = time.perf_counter(), time.thread_time()

    def _ring(self) -> None:
        now, own = time.perf_counter(), time.thread_time()
        self.longest_ms = max(self.longest_ms, 1000.0 * (now - self._last) - INTERVAL_MS)
        self.longest_own_ms = max(self.longest_own_ms, 1000.0 * (own - self._own))
        self._last, self._own = now, own
