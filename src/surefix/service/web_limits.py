"""How often one client may do something: a bucket of turns each, filled again as time goes."""

from __future__ import annotations

from collections import OrderedDict
from typing import Final

__all__ = ["Turns"]

_KNOWN: Final = 4096  # clients that are remembered


class Turns:
    """Turns of each client.

    Parameters
    ----------
    per_s
        Turns that a client gets back every second.
    most
        Turns that it can save up.
    """

    def __init__(self, per_s: float, most: float) -> None:
        self._per_s, self._most = per_s, most
        self._left: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def left(self, client: str, now: float) -> float:
        """Tell how many turns a client has; below 1 it has none."""
        turns, at = self._left.get(client, (self._most, now))
        return min(self._most, turns + self._per_s * max(0.0, now - at))

    def take(self, client: str, now: float) -> bool:
        """Take a turn, if there is one.

        Parameters
        ----------
        client
            Who: its address.
        now
            s, of a clock that never steps back.
        """
        turns = self.left(client, now)
        granted = turns >= 1.0
        self._left[client] = (turns - 1.0 if granted else turns, now)
        self._left.move_to_end(client)
        if len(self._left) > _KNOWN:
            self._left.popitem(last=False)
        return granted
