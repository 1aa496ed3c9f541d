"""Parse connection strings, in the notation that MAVSDK shares."""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass
from enum import Enum

BAUD_RATES = frozenset(
    (9600, 19200, 38400, 57600, 115200, 230400, 460800, 500000, 921600, 1000000, 1500000, 2000000, 3000000)
)
"""Rates that both serial ports and MAVSDK support."""
EXPECTED = "expected udpin://, udpout://, tcpin:// or tcpout://HOST:PORT, or serial://DEVICE:BAUD"


class Scheme(Enum):
    """The transport, and which end connects."""

    UDP_IN = "udpin"
    """We listen, and answer to the vehicle's address."""
    UDP_OUT = "udpout"
    """We connect to the vehicle."""
    TCP_IN = "tcpin"
    TCP_OUT = "tcpout"
    SERIAL = "serial"

    @property
    def is_outgoing(self) -> bool:
        """Whether the remote address is known before its first message."""
        return self in {Scheme.UDP_OUT, Scheme.TCP_OUT, Scheme.SERIAL}


SPELLINGS = {"tcp": Scheme.TCP_OUT} | {scheme.value: scheme for scheme in Scheme}


@dataclass(frozen=True, slots=True)
class Connection:
    """A connection to one or several vehicles."""

    scheme: Scheme
    where: str
    """The host, or the device of a serial port."""
    number: int
    """The port, or the baud rate of a serial port."""

    def __str__(self) -> str:
        """Return the connection string in its full spelling."""
        return f"{self.scheme.value}://{self.where}:{self.number}"

    @property
    def is_on_a_network(self) -> bool:
        """Whether other computers may send to it, by its address."""
        if self.scheme is Scheme.SERIAL or self.where == "localhost":
            return False
        try:
            return not ipaddress.ip_address(self.where).is_loopback
        except ValueError:
            return True

    @property
    def exclusive_resource(self) -> str:
        """The resource only one connection can use: a device, a port of this machine, or a remote address."""
        if self.scheme is Scheme.SERIAL:
            return self.where
        transport = self.scheme.value[:3]
        here = not self.scheme.is_outgoing or self.where in {"127.0.0.1", "localhost"}
        return f"{transport} port {self.number}" if here else f"{transport} {self.where}:{self.number}"


def parse_connection(text: str) -> Connection:
    """Parse a connection string; ``tcp://`` is another spelling of ``tcpout://``.

    Raises:
        ValueError: one line that names what was expected.

    >>> parse_connection("serial:///dev/ttyUSB0:57600")
    Connection(scheme=<Scheme.SERIAL: 'serial'>, where='/dev/ttyUSB0', number=57600)
    """
    found = re.fullmatch(r"([a-z]+)://([^\s:?#]+):([0-9]{1,7})", text, re.ASCII)
    scheme = SPELLINGS.get(found[1]) if found else None
    if found is None or scheme is None:
        raise ValueError(f"{EXPECTED}, got '{text}'")
    where, number = found[2], int(found[3])
    if scheme is Scheme.SERIAL:
        if number not in BAUD_RATES:
            raise ValueError(f"expected a baud rate of {', '.join(map(str, sorted(BAUD_RATES)))}, got '{text}'")
    elif "/" in where or not 0 < number < 65536:
        raise ValueError(f"{EXPECTED}, got '{text}'")
    return Connection(scheme, where, number)
