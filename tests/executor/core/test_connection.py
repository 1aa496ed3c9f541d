"""Connection strings."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executor.core.connection import Connection, Scheme, parse_connection

GOOD = {
    "udpin://10.0.0.9:14550": Connection(Scheme.UDP_IN, "10.0.0.9", 14550),
    "udpout://uav1.local:14550": Connection(Scheme.UDP_OUT, "uav1.local", 14550),
    "tcpin://127.0.0.1:5760": Connection(Scheme.TCP_IN, "127.0.0.1", 5760),
    "tcp://127.0.0.1:5760": Connection(Scheme.TCP_OUT, "127.0.0.1", 5760),
    "serial:///dev/ttyUSB0:57600": Connection(Scheme.SERIAL, "/dev/ttyUSB0", 57600),
    "serial://COM3:115200": Connection(Scheme.SERIAL, "COM3", 115200),
}


@pytest.mark.parametrize("text", GOOD)
def test_a_connection_string_says_who_calls_whom_over_what(text: str) -> None:
    assert parse_connection(text) == GOOD[text]
    assert str(GOOD[text]) == text.replace("tcp://", "tcpout://")


@given(text=st.text() | st.from_regex(r"(udpin|tcp|serial)://[^ ]*:[0-9]*"))
def test_any_text_is_refused_in_one_line_or_read_into_one_spelling(text: str) -> None:
    try:
        connection = parse_connection(text)
    except ValueError:
        with pytest.raises(ValueError, match=r"^expected "):
            parse_connection(text)
    else:
        assert parse_connection(str(connection)) == connection


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("udpin://0.0.0.0:14550", "udpin://127.0.0.1:14550", True),
        ("udpin://0.0.0.0:14550", "udpout://localhost:14550", True),
        ("udpin://0.0.0.0:14550", "tcpin://0.0.0.0:14550", False),
        ("udpout://uav1:14550", "udpout://uav2:14550", False),
        ("serial:///dev/ttyUSB0:57600", "serial:///dev/ttyUSB0:115200", True),
    ],
)
def test_what_two_connections_must_not_share(one: str, other: str, *, same: bool) -> None:
    assert (parse_connection(one).place == parse_connection(other).place) is same
