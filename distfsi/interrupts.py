"""Signals that ask a run to stop early: they are noted from the first import on, and looked at after a step.

It imports nothing that takes time, so that `distfsi run` listens before all else.
"""

from __future__ import annotations

import os
import signal
import time as clock
from collections.abc import Mapping
from typing import Any

SIGNALS = (signal.SIGUSR1, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)

Handlers = Mapping[int, Any]


class Interrupts:
    """What this process has been asked for.

    heard  whether one of SIGNALS has come
    began  when the program began, by the monotonic clock [s]; None where a run is not the program
    """

    def __init__(self) -> None:
        self.heard = False
        self.began: float | None = None
        self._interrupted = False

    def begin_program(self) -> None:
        """Listen from now on, to the end of the process; the wall-clock limit counts from here."""
        if self.began is None:
            self.began = clock.monotonic()
            os.environ.setdefault("UCX_DEBUG_SIGNO", "0")  # a library of MPI takes SIGHUP for itself otherwise
            self.listen()

    def listen(self) -> Handlers:
        """Note signals from now on; the handlers until now. After an interrupt from the keyboard the next one ends the
        process at once, and a hangup that is ignored (nohup) stays so."""
        before = {}
        for number in SIGNALS:
            ignored = number == signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN
            if not ignored and not (number == signal.SIGINT and self._interrupted):
                before[int(number)] = signal.signal(number, self._note)
        return before

    def leave(self, before: Handlers) -> None:
        """Back to the handlers that `listen` returned; what was heard is done with."""
        for number, handler in before.items():
            signal.signal(number, handler)
        self.heard = self._interrupted = False

    def _note(self, number: int, _: object) -> None:
        self.heard = True
        if number == signal.SIGINT:
            self._interrupted = True
            signal.signal(number, signal.SIG_DFL)


interrupts = Interrupts()
