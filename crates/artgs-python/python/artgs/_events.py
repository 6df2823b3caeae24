"""Events of a run, and how they are shown."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TextIO


@dataclass(frozen=True)
class Event:
    """Something that happened during a run. Fields that its kind does not have are None."""

    kind: str
    """``stage_started``, ``progress``, ``stage_finished``, ``warning`` or ``note``."""
    stage: str | None = None
    """Name of the stage."""
    step: int | None = None
    """Steps done."""
    total: int | None = None
    """Steps there will be; 0 where that is not known."""
    loss: float | None = None
    """Value that the stage minimises."""
    psnr: float | None = None
    """Peak signal-to-noise ratio on training pixels, dB."""
    gaussians: int | None = None
    """Number of Gaussians."""
    seconds: float | None = None
    """Wall-clock time of a finished stage."""
    reused: bool | None = None
    """True if the result of an earlier run was taken."""
    message: str | None = None
    """Text of a warning or note."""


Progress = bool | Callable[[Event], object]
"""True: a bar on standard error; False: nothing; a function: it gets every event, and an exception in it ends the run."""


def receiver(progress: Progress) -> Callable[[str], object] | None:
    """What takes the events as JSON."""
    if progress is False:
        return None
    shown: Callable[[Event], object] = Bar(sys.stderr) if progress is True else progress

    def receive(text: str) -> None:
        fields = json.loads(text)
        shown(Event(kind=fields.pop("event"), **fields))

    return receive


class Bar:
    """Finished stages and warnings as lines; on a terminal or in a notebook the running stage as well."""

    period = 0.2

    def __init__(self, out: TextIO) -> None:
        self.out = out
        # Streams of notebooks are no terminals, but know the carriage return.
        self.changes = out.isatty() or type(out).__module__.startswith("ipykernel")
        self.width = 0
        self.drawn = 0.0
        self.warned: set[str] = set()

    def __call__(self, event: Event) -> None:
        if event.kind == "progress" and self.changes:
            now = time.monotonic()
            if now - self.drawn >= self.period:
                self.drawn = now
                self._draw(_running(event))
        elif event.kind == "stage_finished":
            how = "taken from the earlier run" if event.reused else f"done in {event.seconds or 0.0:.1f} s"
            self._line(f"{event.stage}: {how}")
        elif event.kind == "warning" and event.message not in self.warned:
            self.warned.add(event.message or "")
            self._line(f"warning: {event.message}")
        elif event.kind == "note":
            self._line(event.message or "")

    def _draw(self, text: str) -> None:
        self.out.write("\r" + text.ljust(self.width))
        self.out.flush()
        self.width = len(text)

    def _line(self, text: str) -> None:
        if self.width:
            self._draw("")
            self.out.write("\r")
            self.width = 0
        self.out.write(text + "\n")
        self.out.flush()


def _running(event: Event) -> str:
    share = event.step / event.total if event.step is not None and event.total else 0.0
    bar = "#" * int(20 * share)
    numbers = [
        f"PSNR {event.psnr:.1f} dB" if event.psnr is not None else "",
        f"{event.gaussians} Gaussians" if event.gaussians is not None else "",
    ]
    return f"{event.stage:<10} [{bar:<20}] {100 * share:3.0f} % {', '.join(n for n in numbers if n)}".rstrip()
