"""What the user sees while a run goes on."""

from __future__ import annotations

import os
import sys
import time as clock
from collections.abc import Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, TextColumn
from rich.progress import Progress as RichProgress
from rich.table import Column

from distfsi.output.interfaces import Communicator
from distfsi.output.status import Status

SECONDS_BETWEEN_LINES = 5.0
SECONDS_BETWEEN_REDRAWS = 0.2


class Progress:
    """Reports on rank 0 how far the run to `end_time` [s] is: a bar on a terminal, else a line every few seconds; and
    in the file of its `status`."""

    def __init__(self, end_time: float, communicator: Communicator, status: Status | None = None):
        self._end_time, self._status = end_time, status
        self._shown = communicator.rank == 0
        self._bar = self._start_bar() if self._shown and sys.stdout.isatty() else None
        self._interval = SECONDS_BETWEEN_REDRAWS if self._bar else SECONDS_BETWEEN_LINES
        self._reported_step = 0
        self._reported_at: float | None = None
        self._compiled_at = -self._interval

    def compiling(self, number: int) -> None:
        """Report that kernel number `number` of those that this run has to compile is next."""
        now = clock.monotonic()
        if self._shown and now - self._compiled_at >= self._interval:
            self._compiled_at = now
            what = f"compiling kernel {number}, once for this kind of scene"
            self._show(what)
            if self._status:
                self._status.note(what)

    def update(self, step: int, time: float, dt: float, limited_by: str, extra: str = "") -> None:
        """Report step number `step`, which reached `time` [s] with `dt` [s]; `limited_by` says what set `dt`."""
        now = clock.monotonic()
        if self._reported_at is None:  # the first step compiles: the speed is measured from its end
            self._reported_step, self._reported_at = step, now
            return
        if not self._shown or now - self._reported_at < self._interval:
            return
        rate = (step - self._reported_step) / (now - self._reported_at)
        self._reported_step, self._reported_at = step, now
        left = (self._end_time - time) / (dt * rate) if rate > 0.0 and dt > 0.0 else float("inf")
        parts = [
            f"step {step}",
            f"t {format_time(time)} of {format_time(self._end_time)}",
            f"dt {format_time(dt)} ({limited_by})",
            f"{rate:.3g} steps/s",
            f"ETA {format_duration(left)}",
            extra,
        ]
        self._show("  ".join(part for part in parts if part), time)
        if self._status:
            share = 100.0 * time / self._end_time
            lines = {
                "step": f"{step:,}",
                "time": f"{format_time(time)} of {format_time(self._end_time)} ({share:.0f} %)",
                "time step": f"{format_time(dt)}, limited by {limited_by}",
                "speed": f"{rate:.3g} steps/s",
                "left": format_duration(left),
            }
            self._status.note("running", lines)

    def say(self, message: str) -> None:
        """Print `message`; the run goes on."""
        if self._bar:
            with self._heard():
                self._bar.console.print(message, markup=False)
        elif self._shown:
            with self._heard():
                print(message, flush=True)

    def finish(self, message: str) -> None:
        """Take the bar away and print `message`."""
        self.close()
        self.say(message)

    def close(self) -> None:
        """Take the bar away."""
        if self._bar:
            with self._heard():
                self._bar.stop()
            self._bar = None

    @contextmanager
    def _heard(self) -> Iterator[None]:
        """A reader or a terminal that has gone is no reason to end a run: nothing is said any more."""
        try:
            yield
        except OSError:
            self._shown, self._bar = False, None
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115

    def _start_bar(self) -> RichProgress:
        one_line = Column(no_wrap=True, overflow="ellipsis")
        text = TextColumn("{task.description}", markup=False, table_column=one_line)
        bar = RichProgress(BarColumn(bar_width=16), text)
        bar.add_task("", total=self._end_time)
        bar.start()
        return bar

    def _show(self, line: str, time: float | None = None) -> None:
        with self._heard():
            if self._bar:
                self._bar.update(self._bar.task_ids[0], completed=time, description=line)
            else:
                print(line, flush=True)


def format_time(seconds: float) -> str:
    """A physical time in the unit that suits its size: 1.25e-6 is "1.25 µs"."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9)):
        if seconds >= 0.9999 * size:
            return f"{seconds / size:.4g} {unit}"
    return "0 s" if seconds == 0.0 else f"{seconds / 1e-9:.4g} ns"


def format_duration(seconds: float) -> str:
    """A wall-clock time: 4000 is "1 h 06 min"."""
    if seconds == float("inf"):
        return "unknown"
    minutes, hours = int(seconds // 60), int(seconds // 3600)
    if hours:
        return f"{hours} h {minutes % 60:02d} min"
    return f"{minutes} min {int(seconds % 60):02d} s" if minutes else f"{seconds:.0f} s"
