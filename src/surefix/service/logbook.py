"""What happens to a live service, for those who run it: one JSON object a line, and for systemd.

Only what changes is written: an input that breaks or comes back, a sender that may not send, a
client that does not read, an alarm, the first position. Each line has ``time``, ``level``
(``info``, ``warning``, ``error``), ``event``, ``about`` and ``text``.
"""

from __future__ import annotations

import json
import math
import os
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from typing import Final

from surefix.service import alarms
from surefix.service.running import Live

__all__ = ["Logbook", "Watchdog"]

_LEVELS: Final = {"alarm": "error", "warning": "warning", "caution": "warning"}
_OFTEN: Final = 1.0  # s between two signs of life


class Logbook:
    """Writes what has changed since it last looked.

    Parameters
    ----------
    live
        The service.
    write
        Takes a line.
    clock
        s, Unix.
    """

    def __init__(
        self, live: Live, write: Callable[[str], None], clock: Callable[[], float] = time.time
    ) -> None:
        self._live, self._write, self._clock = live, write, clock
        self._inputs = [("", 0)] * len(live.lines)
        self._outputs: list[tuple[int, int]] = []
        self._alarms = live.alarms
        self._settled = False
        self._say("info", "start", "service", f"after {live.taken} pieces in the journal")
        if live.journal.aside:
            self._say("error", "damaged", "journal", f"put aside as {live.journal.aside}")

    def note(self) -> None:
        """Write what has changed."""
        self._look_at_inputs()
        self._look_at_outputs()
        for each in alarms.changed(self._alarms, self._live.alarms):
            told, level = "raised", _LEVELS[each.priority]
            if not math.isnan(each.gone):
                told, level = "cleared", "info"
            elif not math.isnan(each.seen):
                told, level = f"acknowledged by {each.by}", "info"
            self._say(level, "alarm", each.concerns, f"{told}: {each.text}")
        self._alarms = self._live.alarms
        if self._live.now is not None and not self._settled:
            self._settled = True
            self._say("info", "position", "service", "the first position is out")

    def end(self) -> None:
        """Write that the service has ended in order."""
        self._say("info", "stop", "service", f"after {self._live.taken} pieces received")

    def _look_at_inputs(self) -> None:
        options = self._live.options.inputs
        for k, (line, each) in enumerate(zip(self._live.lines, options, strict=True)):
            state = "connected" if line.connected else line.trouble or "waits"
            if line.ended:
                state = "ended"
            before, refused = self._inputs[k]
            if state != before:
                level = "warning" if line.trouble and not line.connected else "info"
                self._say(level, "input", each.name, state)
            if line.refused > refused:
                text = f"{line.refused} refused so far, the last from {line.refused_from}"
                self._say("warning", "sender", each.name, text)
            self._inputs[k] = state, line.refused

    def _look_at_outputs(self) -> None:
        known = self._outputs or [(0, 0)] * len(self._live.outputs)
        self._outputs = [(each.state.dropped, each.state.refused) for _, each in self._live.outputs]
        for (_, output), before in zip(self._live.outputs, known, strict=True):
            state = output.state
            for name, now, then in zip(
                ("did not read", "were too many"),
                (state.dropped, state.refused),
                before,
                strict=True,
            ):
                if now > then:
                    self._say("warning", "client", str(state.address), f"{now} {name}")

    def _say(self, level: str, event: str, about: str, text: str) -> None:
        at = datetime.fromtimestamp(self._clock(), UTC).isoformat(timespec="milliseconds")
        words = {"time": at.replace("+00:00", "Z"), "level": level, "event": event}
        self._write(json.dumps({**words, "about": about, "text": text}, ensure_ascii=False))


class Watchdog:
    """Tells systemd that the service is ready, lives, and stops; elsewhere it does nothing."""

    def __init__(self) -> None:
        self._place = os.environ.get("NOTIFY_SOCKET", "").replace("@", "\0", 1)
        self._last = 0.0

    def alive(self) -> None:
        """Tell that a step is done: the first makes the service ready."""
        now = time.monotonic()
        if now - self._last >= _OFTEN:
            self._tell("READY=1\nWATCHDOG=1" if not self._last else "WATCHDOG=1")
            self._last = now

    def stopping(self) -> None:
        """Tell that it stops in order."""
        self._tell("STOPPING=1")

    def _tell(self, text: str) -> None:
        if self._place:
            with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as out:
                out.sendto(text.encode(), self._place)
