"""Who may see and command the live service over HTTP, and how much of it.

::

    [web]
    address = "0.0.0.0:8000"                     # "127.0.0.1:8000" if left out
    viewer_token_file = "viewer.token"
    operator_token_file = "operator.token"
    origins = ["https://nav.example"]            # names it is reached by, besides IP addresses
"""

from __future__ import annotations

import ipaddress
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final, NamedTuple
from urllib.parse import urlsplit

from surefix.errors import OptionsError

__all__ = ["Token", "WebOptions", "read_web"]

_TOKEN: Final = re.compile(r"[!-~]{16,512}")
_NEW_TOKEN: Final = "python -c 'import secrets; print(secrets.token_urlsafe())' makes one"


class Token(NamedTuple):
    """A secret that lets in, given as such or as the content of a file.

    Parameters
    ----------
    text
        The secret; empty if there is none or it is in a file.
    file
        Where it is read from, each time anew: one that is replaced there no longer lets in.
    """

    text: str = ""
    file: Path | None = None

    def __repr__(self) -> str:
        """Tell where it comes from, never what it is."""
        return f"Token({self.file or ('given' if self.text else 'none')})"

    @property
    def wanted(self) -> bool:
        """Whether there is one at all."""
        return bool(self.text) or self.file is not None

    def now(self) -> str:
        """The secret at present; empty, which lets nobody in, if its file cannot be read."""
        if self.file is None:
            return self.text
        try:
            return self.file.read_text("utf-8").strip()
        except (OSError, UnicodeDecodeError):
            return ""


_NONE: Final = Token()


@dataclass(frozen=True, kw_only=True)
class WebOptions:
    """The web side of the live service.

    Parameters
    ----------
    address
        ``host:port`` to serve at.
    viewer, operator
        What viewers and operators show; operators may acknowledge alarms as well. Without any, on
        loopback, everybody on this machine is an operator.
    origins
        ``https://name[:port]`` by which browsers reach it, if not by an IP address or
        ``localhost``.
    clients
        Most WebSocket clients at a time.
    connections
        Most connections of any kind at a time.
    requests_per_s
        Most requests of one client a second, in the mean over a few seconds.
    body_bytes
        Greatest size of a request's body.
    history_rows
        Cleaned fixes that are kept for looking back.
    """

    address: str = "127.0.0.1:8000"
    viewer: Token = _NONE
    operator: Token = _NONE
    origins: tuple[str, ...] = ()
    clients: int = 50
    connections: int = 250
    requests_per_s: float = 20.0
    body_bytes: int = 16_384
    history_rows: int = 50_000

    def __post_init__(self) -> None:
        _ = self.place  # raises if it is none
        for name in ("clients", "connections", "body_bytes", "history_rows"):
            value = getattr(self, name)
            if not isinstance(value, int) or isinstance(value, bool) or value < 1:
                raise OptionsError(f"[web] {name} = {value!r}", "a whole number above 0")
        rate = self.requests_per_s
        if not isinstance(rate, int | float) or isinstance(rate, bool) or not 0.0 < rate < 1e6:
            raise OptionsError(f"[web] requests_per_s = {rate!r}", "a number above 0")
        for origin in self.origins:
            _check_origin(origin)
        self._check_tokens()

    def _check_tokens(self) -> None:
        for name, token in (("viewer_token", self.viewer), ("operator_token", self.operator)):
            if token.wanted and not _TOKEN.fullmatch(token.now()):
                where = f" from {token.file}" if token.file else ""
                raise OptionsError(
                    f"[web] {name}{where}: not such a token",
                    "16 to 512 characters of ASCII without spaces",
                    _NEW_TOKEN,
                )
        known = [token.now() for token in (self.viewer, self.operator) if token.wanted]
        if len(set(known)) < len(known):
            raise OptionsError("[web] one token for viewers and operators", "two that differ")
        if self.public and not known:
            raise OptionsError(
                f"[web] address {self.address!r}, origins {list(self.origins)}, without a token",
                "viewer_token or operator_token, since others can reach it",
                f"{_NEW_TOKEN}; or take an address of this machine alone, such as 127.0.0.1:8000",
            )

    @property
    def place(self) -> tuple[str, int]:
        """Host and port."""
        wrong = OptionsError(f"[web] address {self.address!r}", "HOST:PORT, such as 127.0.0.1:8000")
        try:
            parts = urlsplit(f"//{self.address}")
            host, port = parts.hostname, parts.port
        except ValueError as error:
            raise wrong from error
        if not host or port is None or parts.netloc != self.address or "@" in self.address:
            raise wrong
        return host, port

    @property
    def public(self) -> bool:
        """Whether anything but this machine can reach it, itself or by what stands before it."""
        hosts = [self.place[0], *(urlsplit(origin).hostname or "" for origin in self.origins)]
        return not all(_is_loopback(host) for host in hosts)


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _check_origin(origin: str) -> None:
    try:
        parts = urlsplit(origin)
        whole = f"{parts.scheme}://{parts.netloc}"
        _ = parts.port  # raises if it is none
    except (ValueError, AttributeError, TypeError):
        whole = ""
    if whole != origin or parts.scheme not in ("http", "https") or not parts.hostname:
        raise OptionsError(f"[web] origin {origin!r}", "https://NAME or https://NAME:PORT")


def read_web(
    place: Path, table: Mapping[str, Any], environment: Mapping[str, str] = os.environ
) -> WebOptions:
    """Read the table ``[web]``.

    A token may also come from ``SUREFIX_VIEWER_TOKEN`` or ``SUREFIX_OPERATOR_TOKEN``.

    Parameters
    ----------
    place
        The options file; files of tokens are found beside it.
    table, environment
        What is given.

    Raises
    ------
    OptionsError
        A key is not known, or a value is wrong.
    """
    plain = {field.name for field in fields(WebOptions)} - {"viewer", "operator"}
    secret = {f"{role}_token{end}" for role in ("viewer", "operator") for end in ("", "_file")}
    for key, value in table.items():
        if key not in plain | secret:
            raise OptionsError(f"{place}: {key!r} in [web]", ", ".join(sorted(plain | secret)))
        if (key in secret or key == "address") and not isinstance(value, str):
            raise OptionsError(f"{place}: [web] {key} is no text", "text")
    origins = table.get("origins", [])
    if not isinstance(origins, list):
        raise OptionsError(f"{place}: [web] origins = {origins!r}", "a list")
    given = {key: value for key, value in table.items() if key in plain}
    tokens = {role: _token(place, table, role, environment) for role in ("viewer", "operator")}
    return WebOptions(**given | tokens | {"origins": tuple(origins)})


def _token(
    place: Path, table: Mapping[str, Any], role: str, environment: Mapping[str, str]
) -> Token:
    text, file = table.get(f"{role}_token"), table.get(f"{role}_token_file")
    if text is not None and file is not None:
        raise OptionsError(f"{place}: [web] {role}_token and {role}_token_file", "one of them")
    if file is not None:
        return Token(file=place.parent / file)
    if text is not None:
        if not text:
            raise OptionsError(f"{place}: [web] an empty {role}_token", "a token", _NEW_TOKEN)
        return Token(text)
    return Token(environment.get(f"SUREFIX_{role.upper()}_TOKEN", ""))
