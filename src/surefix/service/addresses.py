"""Where data come from and go to, as addresses.

========================================  ======================================================
``udp://0.0.0.0:10110``                   datagrams received at, or sent to, a host and port
``tcp://192.168.1.5:2000``                a connection to a server, made again when it breaks
``tcp-listen://127.0.0.1:10110``          a server that others connect to
``serial:///dev/ttyUSB0?baud=4800``       a serial line
``file:///logs/dive.nmea?speed=100``      a recorded log, replayed; ``speed=0``: as fast as can be
``file:track.csv``                        an output: the clean track, recorded
========================================  ======================================================
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final, NamedTuple
from urllib.parse import parse_qs, urlsplit

from surefix.errors import OptionsError

__all__ = ["INPUTS", "OUTPUTS", "RECORDED", "Address", "address"]

INPUTS: Final = ("udp", "tcp", "tcp-listen", "serial", "file")
"""What can be read from."""
OUTPUTS: Final = ("udp", "tcp-listen", "serial", "file")
"""What can be written to."""
RECORDED: Final = (".csv", ".parquet")
"""Kinds of files that a track is recorded in."""

_NETWORK: Final = ("udp", "tcp", "tcp-listen")
_FIGURES: Final = {"serial": {"baud": 4800.0}, "file": {"speed": 1.0}}


class Address(NamedTuple):
    """An address, taken apart.

    Parameters
    ----------
    kind
        One of the schemes.
    host, port
        Of a network address.
    path
        Of a device or a file.
    figure
        Baud, or how many times faster a log is replayed; NaN for a file that is written.
    """

    kind: str
    host: str = ""
    port: int = 0
    path: str = ""
    figure: float = 0.0

    def __str__(self) -> str:
        """Give it as it is written."""
        if self.kind in _NETWORK:
            host = f"[{self.host}]" if ":" in self.host else self.host
            return f"{self.kind}://{host}:{self.port}"
        if math.isnan(self.figure):
            return f"{self.kind}://{self.path}"
        (name,) = _FIGURES[self.kind]
        return f"{self.kind}://{self.path}?{name}={self.figure:g}"


def address(text: str, known: tuple[str, ...]) -> Address:
    """Take an address apart.

    >>> address("udp://0.0.0.0:10110", INPUTS)
    Address(kind='udp', host='0.0.0.0', port=10110, path='', figure=0.0)

    Raises
    ------
    OptionsError
        It is none of the ``known`` kinds, or a part is missing or wrong.
    """
    shown = f"address {text!r}"
    try:
        parts = urlsplit(text)
        port = parts.port
    except ValueError as error:
        raise OptionsError(shown, "a host and a port up to 65535") from error
    kind = parts.scheme
    if kind not in known:
        raise OptionsError(shown, "one that begins with " + ", ".join(f"{k}://" for k in known))
    if kind in _NETWORK:
        if not parts.hostname or port is None or parts.path or parts.query:
            raise OptionsError(shown, f"{kind}://HOST:PORT")
        return Address(kind, parts.hostname, port)
    ((name, usual),) = _FIGURES[kind].items()
    wrong = OptionsError(shown, f"{kind}:///PATH?{name}={usual:g}")
    if known is OUTPUTS and kind == "file":
        if parts.netloc or parts.query or Path(parts.path).suffix not in RECORDED:
            raise OptionsError(shown, "file:PATH that ends in " + " or ".join(RECORDED))
        return Address(kind, path=parts.path, figure=math.nan)
    query = parse_qs(parts.query, keep_blank_values=True)
    if parts.netloc or not parts.path or set(query) - {name}:
        raise wrong
    try:
        figure = float(query[name][-1]) if query else usual
    except ValueError as error:
        raise wrong from error
    if not math.isfinite(figure) or figure < 0.0 or (kind == "serial" and figure == 0.0):
        raise wrong
    return Address(kind, path=parts.path, figure=figure)
