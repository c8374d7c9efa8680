"""Ctrl-C that ends a command when what it does is whole: what was done until then is kept."""

from __future__ import annotations

import signal
import sys
import threading
from types import FrameType, TracebackType


class Interruption:
    """Notes a first Ctrl-C (SIGINT); used as a context, and only in the main thread it catches any.

    Attributes:
        asked: Whether there was one.
    """

    def __init__(self, promise: str) -> None:
        """Take what is said at the first Ctrl-C: what will be done before the end."""
        self.asked = False
        self._promise = promise

    def __enter__(self) -> Interruption:
        self._catches = threading.current_thread() is threading.main_thread()
        if self._catches:
            self._before = signal.signal(signal.SIGINT, self._note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._catches:
            signal.signal(signal.SIGINT, self._before)

    def _note(self, number: int, frame: FrameType | None) -> None:
        """Take the signal.

        Raises:
            KeyboardInterrupt: It is not the first one.
        """
        del number, frame
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True
        print(f"interrupted: {self._promise}; Ctrl-C again ends at once", file=sys.stderr, flush=True)
