"""Another ground station of a real autopilot: parameters, missions and keys, over a connection of its own."""

from __future__ import annotations

import contextlib
import math
import socket
import struct
import time
from collections.abc import Iterator, Sequence
from typing import Any

from pymavlink.dialects.v20 import common as mav

HOST = "127.0.0.1"
ANSWER_S = 1.0
TRIES = 5
SIGNING_EPOCH_UNIX_S, SIGNING_TICKS_PER_S = 1420070400, 100_000
FLOAT = mav.MAV_PARAM_TYPE_REAL32


class OtherLink:
    """Where a vehicle takes a second ground station: one socket for its whole life, as PX4 answers only the first."""

    def __init__(self, kind: socket.SocketKind, port: int, *, bytewise: bool) -> None:
        """Take a port of the vehicle's.

        Args:
            kind: Datagrams or a stream.
            port: Where the vehicle listens.
            bytewise: Whether an integer's bytes stand in the message's float, as PX4 has it.
        """
        self.bytewise = bytewise
        self._kind = kind
        self._port = port
        self._plug: socket.socket | None = None
        self._codec = mav.MAVLink(None, srcSystem=254, srcComponent=190)
        self._codec.robust_parsing = True

    def set(self, sysid: int, name: str, value: float, patience_s: float) -> None:
        """Set a parameter and see the new value; waits for a vehicle that is starting.

        Raises:
            TimeoutError: it was not set in real seconds.
        """
        until_s = time.monotonic() + patience_s
        while time.monotonic() < until_s:
            with contextlib.suppress(OSError):
                if self._set(self._connected(), sysid, name, value):
                    return
            time.sleep(0.05)
        raise TimeoutError(f"system {sysid}: {name} was not set over port {self._port}")

    def all(self, sysid: int, patience_s: float = 60.0) -> dict[str, float]:
        """Return every parameter that a vehicle has, as its bits go over the wire.

        Raises:
            TimeoutError: they did not all come in real seconds.
        """
        until_s, found, count = time.monotonic() + patience_s, dict[int, tuple[str, float]](), 0
        plug = self._connected()
        plug.send(self._codec.param_request_list_encode(sysid, 1).pack(self._codec))
        while time.monotonic() < until_s:
            for message in self._heard(plug, 2.0):
                if message.param_index < message.param_count:
                    found[message.param_index] = (message.param_id, message.param_value)
                    count = message.param_count
            missing = [index for index in range(count) if index not in found]
            if count and not missing:
                return dict(found.values())
            for index in missing[:50]:
                plug.send(self._codec.param_request_read_encode(sysid, 1, b"", index).pack(self._codec))
        raise TimeoutError(f"system {sysid}: {count - len(found)} parameters never came over port {self._port}")

    def _heard(self, plug: socket.socket, quiet_s: float) -> Iterator[mav.MAVLink_param_value_message]:
        """Yield values until none has come for a while."""
        until_s = time.monotonic() + quiet_s
        while time.monotonic() < until_s:
            with contextlib.suppress(TimeoutError):
                for message in self._codec.parse_buffer(plug.recv(65536)) or ():
                    if message.get_type() == "PARAM_VALUE":
                        until_s = time.monotonic() + quiet_s
                        yield message

    def sign(self, sysid: int, key: bytes, patience_s: float = 60.0) -> None:
        """Have a vehicle on the ground sign what it says, and ask the same of others; waits for one that starts.

        Raises:
            TimeoutError: it did not begin in real seconds.
        """
        until_s, order = time.monotonic() + patience_s, list(key)
        while time.monotonic() < until_s:
            with contextlib.suppress(OSError):
                plug = self._connected()
                ticks = round((time.time() - SIGNING_EPOCH_UNIX_S) * SIGNING_TICKS_PER_S)
                plug.send(mav.MAVLink_setup_signing_message(sysid, 1, order, ticks).pack(self._codec))
                beat = self._next(plug, ("HEARTBEAT",))
                if beat.get_header().incompat_flags & mav.MAVLINK_IFLAG_SIGNED:
                    return
            time.sleep(0.05)
        raise TimeoutError(f"system {sysid} does not sign over port {self._port}")

    def mission(self, sysid: int, kind: int = 0) -> list[mav.MAVLink_mission_item_int_message]:
        """Return the mission, the fence (1) or the rally points (2) that a vehicle carries."""
        count = self.ask(mav.MAVLink_mission_request_list_message(sysid, 1, kind), "MISSION_COUNT").count
        items = [
            self.ask(mav.MAVLink_mission_request_int_message(sysid, 1, seq, kind), "MISSION_ITEM_INT")
            for seq in range(count)
        ]
        self.say(mav.MAVLink_mission_ack_message(sysid, 1, mav.MAV_MISSION_ACCEPTED, kind))
        return items

    def upload(self, sysid: int, items: Sequence[mav.MAVLink_mission_item_int_message], kind: int = 0) -> None:
        """Put a mission, a fence (1) or rally points (2) on board, as another ground station does."""
        answers = ("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK")
        answer = self.ask(mav.MAVLink_mission_count_message(sysid, 1, len(items), kind), *answers)
        while answer.get_type() != "MISSION_ACK":
            answer = self.ask(items[answer.seq], *answers)
        assert answer.type == mav.MAV_MISSION_ACCEPTED, f"system {sysid} refuses the mission: {answer.type}"

    def ask(self, message: mav.MAVLink_message, *answers: str) -> Any:
        """Send a message until one of these kinds answers it.

        Raises:
            TimeoutError: none does.
        """
        plug = self._connected()
        self._drain(plug)
        for _ in range(TRIES):
            plug.send(message.pack(self._codec))
            with contextlib.suppress(TimeoutError):
                return self._next(plug, answers)
        raise TimeoutError(f"port {self._port}: {message.get_type()} was not answered by {answers}")

    def _drain(self, plug: socket.socket) -> None:
        """Pass over what came while nobody listened."""
        plug.setblocking(False)
        try:
            while plug.recv(65536):
                pass
        except BlockingIOError:
            pass
        finally:
            plug.settimeout(ANSWER_S)

    def _next(self, plug: socket.socket, kinds: Sequence[str]) -> Any:
        until_s = time.monotonic() + ANSWER_S
        while time.monotonic() < until_s:
            for message in self._codec.parse_buffer(plug.recv(65536)) or ():
                if message.get_type() in kinds and message.get_srcComponent() == 1:
                    return message
        raise TimeoutError

    def say(self, message: mav.MAVLink_message, system: int = 254) -> None:
        """Send one message as another ground station does."""
        self._codec.srcSystem = system
        try:
            self._connected().send(message.pack(self._codec))
        finally:
            self._codec.srcSystem = 254

    def close(self) -> None:
        """Hang up."""
        if self._plug is not None:
            self._plug.close()

    def _connected(self) -> socket.socket:
        if self._plug is None:
            plug = socket.socket(socket.AF_INET, self._kind)
            try:
                plug.settimeout(ANSWER_S)
                plug.connect((HOST, self._port))
            except OSError:
                plug.close()
                raise
            self._plug = plug
        return self._plug

    def _set(self, plug: socket.socket, sysid: int, name: str, value: float) -> bool:
        plug.send(self._codec.param_request_read_encode(sysid, 1, name.encode(), -1).pack(self._codec))
        known = self._answer(plug, name)
        raw = value
        if self.bytewise and known.param_type != FLOAT:
            raw = struct.unpack("<f", struct.pack("<i", int(value)))[0]
        plug.send(self._codec.param_set_encode(sysid, 1, name.encode(), raw, known.param_type).pack(self._codec))
        return math.isclose(self._answer(plug, name).param_value, raw, rel_tol=1e-5)

    def _answer(self, plug: socket.socket, name: str) -> mav.MAVLink_param_value_message:
        until_s = time.monotonic() + ANSWER_S
        while time.monotonic() < until_s:
            for message in self._codec.parse_buffer(plug.recv(65536)) or ():
                if message.get_type() == "PARAM_VALUE" and message.param_id == name:
                    return message
        raise TimeoutError
