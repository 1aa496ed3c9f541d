"""Connection strings: how a vehicle is reached, in the notation that MAVSDK takes too."""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass
from enum import Enum

BAUD_RATES = frozenset(
    (9600, 19200, 38400, 57600, 115200, 230400, 460800, 500000, 921600, 1000000, 1500000, 2000000, 3000000)
)
"""What serial ports and MAVSDK both know."""
EXPECTED = "expected udpin://, udpout://, tcpin:// or tcpout://HOST:PORT, or serial://DEVICE:BAUD"


class Scheme(Enum):
    """Who calls whom, over what."""

    UDP_IN = "udpin"
    """We listen, and answer where the vehicle calls from."""
    UDP_OUT = "udpout"
    """We call the vehicle."""
    TCP_IN = "tcpin"
    TCP_OUT = "tcpout"
    SERIAL = "serial"

    @property
    def is_outgoing(self) -> bool:
        """Whether the other end is known before it has said anything."""
        return self in {Scheme.UDP_OUT, Scheme.TCP_OUT, Scheme.SERIAL}


SPELLINGS = {"tcp": Scheme.TCP_OUT} | {scheme.value: scheme for scheme in Scheme}


@dataclass(frozen=True, slots=True)
class Connection:
    """One way to one or several vehicles."""

    scheme: Scheme
    where: str
    """The host, or the device of a serial port."""
    number: int
    """The port, or the baud rate of a serial port."""

    def __str__(self) -> str:
        """Return the connection string, in its one full spelling."""
        return f"{self.scheme.value}://{self.where}:{self.number}"

    @property
    def is_on_a_network(self) -> bool:
        """Whether others than this computer may send to it, as far as its address tells."""
        if self.scheme is Scheme.SERIAL or self.where == "localhost":
            return False
        try:
            return not ipaddress.ip_address(self.where).is_loopback
        except ValueError:
            return True

    @property
    def exclusive_resource(self) -> str:
        """What only one connection can use: a device, a port of this machine, or an address elsewhere."""
        if self.scheme is Scheme.SERIAL:
            return self.where
        transport = self.scheme.value[:3]
        here = not self.scheme.is_outgoing or self.where in {"127.0.0.1", "localhost"}
        return f"{transport} port {self.number}" if here else f"{transport} {self.where}:{self.number}"


def parse_connection(text: str) -> Connection:
    """Read a connection string; ``tcp://`` is another spelling of ``tcpout://``.

    Raises:
        ValueError: one line that says what was expected.

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
