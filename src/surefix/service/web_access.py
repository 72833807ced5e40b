"""Who asks, and may they: tokens, sessions of browsers, and the names a service is reached by."""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
from collections.abc import Mapping
from http.cookies import CookieError, SimpleCookie
from typing import Final, Literal
from urllib.parse import urlsplit

from surefix.service.web_options import Token, WebOptions

__all__ = ["SESSION_S", "Role", "cookie_name", "host_known", "origin_known", "role_of", "session"]

SESSION_S: Final = 12 * 3600
"""s that a browser stays signed in."""

Role = Literal["viewer", "operator", "wrong", "nobody"]
"""Who asks; ``wrong`` showed a token or a session that is not, or no longer, good."""


def role_of(options: WebOptions, headers: Mapping[str, str], now: float) -> Role:
    """Tell who asks, by a token in ``Authorization: Bearer …`` or a browser's session.

    Parameters
    ----------
    options
        Which tokens there are.
    headers
        Of the request, in lower case.
    now
        s, Unix.
    """
    shown = headers.get("authorization")
    if shown is not None:
        kind, _, token = shown.partition(" ")
        return _by_token(options, token.strip()) if kind.lower() == "bearer" else "wrong"
    cookie = _cookie(headers.get("cookie", ""), cookie_name(options))
    if cookie and (options.viewer.wanted or options.operator.wanted):
        return _by_session(options, cookie, now)
    if options.public or options.viewer.wanted:
        return "nobody"
    return "viewer" if options.operator.wanted else "operator"


def _tokens(options: WebOptions) -> tuple[tuple[Role, Token], ...]:
    return ("operator", options.operator), ("viewer", options.viewer)


def _by_token(options: WebOptions, token: str) -> Role:
    found: Role = "wrong"
    for role, known in _tokens(options):  # all are compared, whichever it is
        if _same(known.now(), token):
            found = role
    return found


def _same(known: str, shown: str) -> bool:
    return bool(known) and hmac.compare_digest(known.encode(), shown.encode("utf-8", "replace"))


def session(options: WebOptions, role: Role, now: float) -> str:
    """Make what a browser shows instead of the token; it ends after `SESSION_S`, or with the token.

    Parameters
    ----------
    options
        Which tokens there are.
    role
        Whose session it is.
    now
        s, Unix.
    """
    said = f"{role}.{int(now) + SESSION_S}"
    return f"{said}.{_seal(dict(_tokens(options))[role].now(), said)}"


def _by_session(options: WebOptions, cookie: str, now: float) -> Role:
    said, _, seal = cookie.rpartition(".")
    for role, token in _tokens(options):
        key = token.now()
        if said.startswith(f"{role}.") and key and _same(_seal(key, said), seal):
            return role if now < int(said.partition(".")[2]) else "wrong"
    return "wrong"


def _seal(key: str, said: str) -> str:
    return hmac.new(key.encode(), said.encode("utf-8", "replace"), hashlib.sha256).hexdigest()


def cookie_name(options: WebOptions) -> str:
    """Name of the cookie: services at other ports of a machine have others."""
    return f"surefix_{options.place[1]}"


def _cookie(text: str, name: str) -> str:
    try:
        found = SimpleCookie(text).get(name)
    except CookieError:
        return ""
    return found.value if found else ""


def host_known(options: WebOptions, host: str) -> bool:
    """Tell whether the service goes by the name of a ``Host`` header.

    A foreign page can let its own name stand for our address (DNS rebinding), but it cannot make a
    browser call us by our address, or by a name that we know.
    """
    try:
        name = urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return False
    names = {urlsplit(origin).hostname for origin in options.origins}
    if name in names | {"localhost", options.place[0]}:
        return True
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def origin_known(options: WebOptions, origin: str, host: str) -> bool:
    """Tell whether a request comes from a page of this service: same host and port, or listed."""
    if origin in options.origins:
        return True
    parts = origin.partition("://")
    return parts[0] in ("http", "https") and parts[2].lower() == host.lower() != ""
