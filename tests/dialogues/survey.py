"""What an autopilot answers at all: every message that can be requested, and every command on the ground.

A vehicle stands on its pad, ready and disarmed. What it says to a command that is filled with zeros tells whether it
knows it, and no more. Commands that a bystander would not give are left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from missions import dialect_for
from simulator.config import AutopilotKind
from tests.dialogues import facts
from tests.dialogues.acts import Until, What
from tests.dialogues.station import Station
from tests.dialogues.wires import SimulatedWire

BEGIN, END = "<!-- survey -->\n", "<!-- end -->\n"
WAIT_S, COMES_S, TRIES = 0.6, 0.25, 3
LEFT_OUT = ("PREFLIGHT_", "COMPONENT_ARM_DISARM", "DO_FLIGHTTERMINATION", "DO_START_MAG_CAL", "RUN_PREARM", "START_RX")
"""Restarts, calibrations, and what stops motors for good."""
QUESTIONS = frozenset({510, 511, 512, 521, 530, 2504})
"""They ask for messages, which have a list of their own."""
ANSWERS = frozenset({"COMMAND_ACK", "MESSAGE_INTERVAL", "PARAM_VALUE", "STATUSTEXT", "FILE_TRANSFER_PROTOCOL"})
"""They come when they are due, whoever asks."""
SILENCE = "no answer"
UNSUPPORTED = "UNSUPPORTED"

Survey = Mapping[str, Mapping[str, str]]
"""Messages that come, and commands by what is said to them."""


class Surveyor(Station):
    """A station that asks for everything."""

    def survey(self) -> Survey:
        self._meet()
        self._act(Until(What.READY))
        return {"messages": dict(self._request_messages()), "commands": dict(self._give_commands())}

    def _request_messages(self) -> Iterator[tuple[str, str]]:
        for number, kind in sorted(mavlink.mavlink_map.items()):
            if kind.msgname in ANSWERS:
                continue
            self._last.pop(kind.msgname, None)
            self._ask(mavlink.MAV_CMD_REQUEST_MESSAGE, float(number))
            if kind.msgname in self._last:
                yield kind.msgname, "comes"

    def _give_commands(self) -> Iterator[tuple[str, str]]:
        for number, entry in sorted(mavlink.enums["MAV_CMD"].items()):
            name = entry.name.removeprefix("MAV_CMD_")
            if number in QUESTIONS or name.startswith(LEFT_OUT) or name == "ENUM_END":
                continue
            result = self._ask(number)
            if result != UNSUPPORTED:
                yield name, result

    def _ask(self, number: int, *params: float) -> str:
        """Return the last that is said to a command, which is given again when nothing is."""
        for _ in range(TRIES):
            self._inbox.clear()
            self._say_command(number, *params)
            until_s, result = self._wire.now_s + WAIT_S, None
            while self._wire.now_s < until_s:
                self._pass()
                for one in self._inbox:
                    if one.get_type() == "COMMAND_ACK" and one.command == number:
                        result, until_s = one.result, self._wire.now_s + (0.0 if one.result else COMES_S)
                self._inbox.clear()
            if result is not None:
                named = mavlink.enums["MAV_RESULT"].get(result)
                return str(result) if named is None else str(named.name).removeprefix("MAV_RESULT_")
        return SILENCE


def simulated(autopilot: str) -> Survey:
    """Return what a simulated vehicle answers."""
    return Surveyor(SimulatedWire(AutopilotKind(autopilot)), dialect_for(autopilot)).survey()


def real(autopilot: str) -> Survey:
    """Return what the real one answered."""
    found: dict[str, dict[str, str]] = {}
    for line in (facts.ANSWERS / f"survey-{autopilot}.txt").read_text(encoding="utf-8").splitlines():
        kind, name, said = line.split(" ", 2)
        found.setdefault(kind, {})[name] = said
    return found


def write(autopilot: str, survey: Survey) -> None:
    """Write what a real autopilot answered."""
    lines = [f"{kind} {name} {said}\n" for kind, answers in survey.items() for name, said in answers.items()]
    (facts.ANSWERS / f"survey-{autopilot}.txt").write_text("".join(lines), encoding="utf-8")


def table() -> str:
    """Return what the real ones answer and the simulated ones do not."""
    rows = []
    for autopilot, version in facts.VERSIONS.items():
        theirs, ours = real(autopilot), simulated(autopilot)
        for kind, answers in theirs.items():
            of_them = {name: said for name, said in answers.items() if said != SILENCE}
            of_us = {name: said for name, said in ours[kind].items() if said != SILENCE}
            missing = [name for name in of_them if name not in of_us]
            other = [f"{name} {of_us[name]}" for name, said in of_them.items() if of_us.get(name, said) != said]
            more = [name for name in of_us if name not in of_them]
            both = len(of_them) - len(missing)
            rows.append([version, kind, f"{both} of {len(of_them)}", *map(_join, (missing, other, more))])
    head = ["autopilot", "what", "answered by both", "by the real one alone", "otherwise here", "here alone"]
    return "".join(f"| {' | '.join(row)} |\n" for row in (head, ["---"] * len(head), *rows))


def _join(names: list[str]) -> str:
    return ", ".join(names) or "none"


def with_table(page: str) -> str:
    """Return the page with the table as it should be."""
    head, found, rest = page.partition(BEGIN)
    assert found, "the page has no place for the survey"
    return head + BEGIN + table() + END + rest.partition(END)[2]
