"""What an autopilot answers at all: every message that can be requested, every command on the ground, files.

A vehicle stands on its pad, ready and disarmed. What it says to a command that is filled with zeros is no more than
that: whether it knows it. Commands that a bystander would not give are left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from missions import Dialect
from tests.dialogues.acts import Until, What
from tests.dialogues.station import Station
from tests.dialogues.wires import Wire

RESULTS = mavlink.enums["MAV_RESULT"]
WAIT_S = 0.6
TRIES = 3
LEFT_OUT = ("PREFLIGHT_", "COMPONENT_ARM_DISARM", "DO_FLIGHTTERMINATION", "DO_START_MAG_CAL", "RUN_PREARM", "START_RX")
"""Restarts, calibrations, and what stops motors for good."""
QUESTIONS = frozenset({510, 511, 512})
"""They have their own dialogue."""


class Surveyor(Station):
    """A station that asks for everything."""

    def __init__(self, wire: Wire, dialect: Dialect) -> None:
        super().__init__(wire, dialect)
        self._came: dict[str, Any] = {}

    def survey(self) -> dict[str, list[str]]:
        """Return what came of it: chapters with lines."""
        self._meet()
        self._act(Until(What.READY))
        return {
            "messages": list(self._request_messages()),
            "commands": list(self._give_commands()),
        }

    def _request_messages(self) -> Iterator[str]:
        for number, kind in sorted(mavlink.mavlink_map.items()):
            for _ in range(TRIES):
                self._last.pop(kind.msgname, None)
                result = self._ask(mavlink.MAV_CMD_REQUEST_MESSAGE, float(number))
                if result is not None:
                    break
            if kind.msgname in self._last:
                yield f"{kind.msgname}"
            elif result == 0:
                yield f"{kind.msgname} accepted, and does not come"

    def _give_commands(self) -> Iterator[str]:
        for number, entry in sorted(mavlink.enums["MAV_CMD"].items()):
            name = entry.name.removeprefix("MAV_CMD_")
            if number in QUESTIONS or name.startswith(LEFT_OUT) or name == "ENUM_END":
                continue
            for _ in range(TRIES):
                result = self._ask(number)
                if result is not None:
                    break
            if result not in {mavlink.MAV_RESULT_UNSUPPORTED}:
                known = RESULTS.get(result)
                yield f"{name} {known.name.removeprefix('MAV_RESULT_') if known else result}"

    def _ask(self, number: int, *params: float) -> int | None:
        self._inbox.clear()
        self._say_command(number, *params)
        until_s, result = self._wire.now_s + WAIT_S, None
        while self._wire.now_s < until_s:
            self._pass()
            for one in self._inbox:
                if one.get_type() == "COMMAND_ACK" and one.command == number:
                    result = one.result
            self._inbox.clear()
            if result is not None and until_s - self._wire.now_s > 0.2:
                until_s = self._wire.now_s + 0.2
        return result
