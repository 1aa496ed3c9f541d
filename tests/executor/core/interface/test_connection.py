"""Connection strings."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executor.core.interface.connection import Connection, Scheme, parse_connection

GOOD = {
    "udpin://10.0.0.9:14550": Connection(Scheme.UDP_IN, "10.0.0.9", 14550),
    "udpout://uav1.local:14550": Connection(Scheme.UDP_OUT, "uav1.local", 14550),
    "tcpin://127.0.0.1:5760": Connection(Scheme.TCP_IN, "127.0.0.1", 5760),
    "tcp://127.0.0.1:5760": Connection(Scheme.TCP_OUT, "127.0.0.1", 5760),
    "serial:///dev/ttyUSB0:57600": Connection(Scheme.SERIAL, "/dev/ttyUSB0", 57600),
    "serial://COM3:115200": Connection(Scheme.SERIAL, "COM3", 115200),
}


@pytest.mark.parametrize("text", GOOD)
def test_a_connection_string_gives_direction_and_transport(text: str) -> None:
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
    assert (parse_connection(one).exclusive_resource == parse_connection(other).exclusive_resource) is same


RATES = (9600, 19200, 38400, 57600, 115200, 230400, 460800, 500000, 921600, 1000000, 1500000, 2000000, 3000000)


def test_the_baud_rates_are_those_of_serial_ports() -> None:
    for rate in RATES:
        assert parse_connection(f"serial:///dev/ttyUSB0:{rate}").number == rate
    for rate in (0, 9599, 9601, 57599, 57601, 115201, 921601, 2999999):
        with pytest.raises(ValueError, match=r"expected a baud rate of 9600, 19200, .*, 3000000, got"):
            parse_connection(f"serial:///dev/ttyUSB0:{rate}")


@pytest.mark.parametrize(("port", "good"), [(0, False), (1, True), (65535, True), (65536, False)])
def test_the_ports_of_a_network(port: int, *, good: bool) -> None:
    if good:
        assert parse_connection(f"udpin://0.0.0.0:{port}").number == port
    else:
        with pytest.raises(ValueError, match=r"^expected udpin://"):
            parse_connection(f"udpin://0.0.0.0:{port}")


@pytest.mark.parametrize(
    ("text", "others"),
    [
        ("serial:///dev/ttyUSB0:57600", False),
        ("udpin://127.0.0.1:14550", False),
        ("udpin://localhost:14550", False),
        ("udpin://0.0.0.0:14550", True),
        ("tcpout://10.0.0.9:5760", True),
        ("tcpout://uav1.local:5760", True),
    ],
)
def test_whether_others_can_send_to_it(text: str, *, others: bool) -> None:
    assert parse_connection(text).is_on_a_network is others


@pytest.mark.parametrize(
    ("text", "calls"),
    [
        ("udpin://h:1", False),
        ("tcpin://h:1", False),
        ("udpout://h:1", True),
        ("tcpout://h:1", True),
        ("serial://h:9600", True),
    ],
)
def test_the_direction_of_a_connection(text: str, *, calls: bool) -> None:
    assert parse_connection(text).scheme.is_outgoing is calls


def test_a_place_is_a_port_here_or_an_address_elsewhere() -> None:
    assert parse_connection("udpin://0.0.0.0:14550").exclusive_resource == "udp port 14550"
    assert parse_connection("udpout://127.0.0.1:14550").exclusive_resource == "udp port 14550"
    assert parse_connection("tcpout://10.0.0.9:5760").exclusive_resource == "tcp 10.0.0.9:5760"
