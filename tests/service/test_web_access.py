"""Who may: every kind of asker, at every kind of service."""

import pytest

from service.web_made import NOON, OPERATOR, VIEWER, web_options
from surefix.errors import OptionsError
from surefix.service.web_access import (
    SESSION_S,
    cookie_name,
    host_known,
    origin_known,
    role_of,
    session,
)
from surefix.service.web_limits import Turns
from surefix.service.web_options import Token, WebOptions

HERE, ALL = "127.0.0.1:8000", "0.0.0.0:8000"
V, O = Token(VIEWER), Token(OPERATOR)
NONE = Token()


@pytest.mark.parametrize(
    ("address", "viewer", "operator", "nothing", "with_viewer", "with_operator"),
    [
        (HERE, NONE, NONE, "operator", "wrong", "wrong"),
        (HERE, V, NONE, "nobody", "viewer", "wrong"),
        (HERE, NONE, O, "viewer", "wrong", "operator"),
        (HERE, V, O, "nobody", "viewer", "operator"),
        (ALL, V, NONE, "nobody", "viewer", "wrong"),
        (ALL, NONE, O, "nobody", "wrong", "operator"),
        (ALL, V, O, "nobody", "viewer", "operator"),
    ],
)
def test_roles(address, viewer, operator, nothing, with_viewer, with_operator):
    options = WebOptions(address=address, viewer=viewer, operator=operator)
    assert role_of(options, {}, NOON) == nothing
    for token, role in ((VIEWER, with_viewer), (OPERATOR, with_operator)):
        assert role_of(options, {"authorization": f"Bearer {token}"}, NOON) == role
    for wrong in ("Bearer", "Bearer ", f"Bearer {VIEWER}x", f"Basic {OPERATOR}", "Bearer é"):
        assert role_of(options, {"authorization": wrong}, NOON) == "wrong"


def test_a_session_ends_with_its_time_or_its_token():
    options = WebOptions(address=HERE, viewer=V, operator=O)
    name = cookie_name(options)

    def role(cookie, now=NOON, options=options):
        return role_of(options, {"cookie": f"other=1; {name}={cookie}"}, now)

    for known in ("viewer", "operator"):
        cookie = session(options, known, NOON)
        assert role(cookie) == role(cookie, NOON + SESSION_S - 1.0) == known
        assert role(cookie, NOON + SESSION_S) == "wrong"
        other = WebOptions(address=HERE, viewer=Token("x" * 20), operator=Token("y" * 20))
        assert role(cookie, options=other) == "wrong"
    cookie = session(options, "viewer", NOON)
    for forged in (
        cookie.replace("viewer", "operator"),
        cookie.replace("viewer.1", "viewer.2"),
        cookie[:-1],
        cookie + "0",
        "..",
        "operator.9999999999.",
        "operator.x." + "0" * 64,
    ):
        assert role(forged) == "wrong"


def test_a_token_in_a_file_is_replaced_without_a_restart(tmp_path):
    (tmp_path / "operator.token").write_text(OPERATOR + "\n")
    options = web_options(tmp_path, 'operator_token_file = "operator.token"').web
    cookie = {"cookie": f"{cookie_name(options)}={session(options, 'operator', NOON)}"}
    bearer = {"authorization": f"Bearer {OPERATOR}"}
    assert role_of(options, bearer, NOON) == role_of(options, cookie, NOON) == "operator"
    (tmp_path / "operator.token").write_text("another-token-0123456789")
    assert role_of(options, bearer, NOON) == role_of(options, cookie, NOON) == "wrong"
    (tmp_path / "operator.token").unlink()
    assert role_of(options, {"authorization": "Bearer "}, NOON) == "wrong"
    assert role_of(options, {}, NOON) == "viewer"


def test_tokens_come_from_the_environment_and_are_not_shown(tmp_path, monkeypatch):
    monkeypatch.setenv("SUREFIX_VIEWER_TOKEN", VIEWER)
    options = web_options(tmp_path, address=ALL)
    assert role_of(options.web, {"authorization": f"Bearer {VIEWER}"}, NOON) == "viewer"
    assert VIEWER not in repr(options)


@pytest.mark.parametrize(
    ("more", "address", "said"),
    [
        ("", ALL, "viewer_token or operator_token"),
        ("", "[::]:8000", "viewer_token or operator_token"),
        ("", "boat.example:80", "viewer_token or operator_token"),
        ('origins = ["https://boat.example"]', HERE, "viewer_token or operator_token"),
        ('viewer_token = "short"', HERE, "16 to 512"),
        ('viewer_token = ""', HERE, "empty"),
        ('viewer_token = "with a space in it"', HERE, "16 to 512"),
        ('viewer_token_file = "absent"', HERE, "16 to 512"),
        (f'viewer_token = "{VIEWER}"\nviewer_token_file = "x"', HERE, "one of them"),
        (f'viewer_token = "{VIEWER}"\noperator_token = "{VIEWER}"', HERE, "two that differ"),
        ("viewer_token = 12345678901234567", HERE, "text"),
        ('origins = ["boat.example"]', HERE, "https://NAME"),
        ('origins = ["https://boat.example/"]', HERE, "https://NAME"),
        ("origins = [1]", HERE, "https://NAME"),
        ('origins = "https://boat.example"', HERE, "a list"),
        ("clients = 0", HERE, "above 0"),
        ("clients = true", HERE, "above 0"),
        ("history_rows = 1.5", HERE, "whole number"),
        ("requests_per_s = -1", HERE, "above 0"),
        ("requests_per_s = nan", HERE, "above 0"),
        ("port = 1", HERE, "'port' in .web."),
        ("", "127.0.0.1", "HOST:PORT"),
        ("", "127.0.0.1:99999", "HOST:PORT"),
        ("", "http://127.0.0.1:80", "HOST:PORT"),
        ("", "a@127.0.0.1:80", "HOST:PORT"),
    ],
)
def test_options_that_are_wrong_are_told(tmp_path, more, address, said):
    with pytest.raises(OptionsError, match=said) as error:
        web_options(tmp_path, more, address)
    assert VIEWER not in str(error.value)


@pytest.mark.parametrize(
    ("host", "known"),
    [
        ("127.0.0.1:8000", True), ("localhost:8000", True), ("LOCALHOST", True),
        ("[::1]:8000", True), ("192.168.1.7", True), ("boat.example:8443", True),
        ("boat.example", True),
        ("evil.example", False), ("localhost.evil.example:8000", False), ("", False),
        ("127.0.0.1.evil.example", False), ("[::1", False), ("boat.example@evil.example", False),
    ],
)  # fmt: skip
def test_hosts(host, known):
    options = WebOptions(origins=("https://boat.example",), operator=O)
    assert host_known(options, host) is known


@pytest.mark.parametrize(
    ("origin", "known"),
    [
        ("http://127.0.0.1:8000", True), ("https://boat.example", True), ("null", False),
        ("", False), ("http://127.0.0.1:8001", False), ("http://127.0.0.1", False),
        ("http://boat.example", False), ("https://boat.example.evil.example", False),
        ("file://127.0.0.1:8000", False),
        ("http://evil.example", False),
    ],
)  # fmt: skip
def test_origins(origin, known):
    options = WebOptions(origins=("https://boat.example",), operator=O)
    assert origin_known(options, origin, "127.0.0.1:8000") is known
    assert not origin_known(options, "http://", "")


def test_turns_come_back_and_clients_do_not_take_each_others():
    turns = Turns(2.0, 5.0)
    assert [turns.take("a", 0.0) for _ in range(7)] == [True] * 5 + [False] * 2
    assert turns.take("b", 0.0)
    assert [turns.take("a", 1.0) for _ in range(3)] == [True, True, False]
    assert [turns.take("a", 100.0) for _ in range(6)] == [True] * 5 + [False]
    for n in range(10_000):
        turns.take(str(n), 100.0)
    assert len(turns._left) <= 4096
