"""What vehicles say in words, shown without drowning the crew: a faulty one may say a thousand things a second.

Everything is in the event log. Of what is worth a line a part is shown in each window of time, the important first, and
the rest is counted in one line.
"""

from __future__ import annotations

import re
from dataclasses import replace
from enum import IntEnum

from executor.core.context import Scene
from executor.core.formatting import format_count
from executor.core.interface.commands import Command, Say
from executor.core.interface.messages import ComponentText, StatusText, TextMessage
from executor.core.lines import link
from executor.core.state.fleet_state import FleetState, Stepped
from executor.core.state.vehicle_parts import TextWindow
from executor.core.state.vehicle_state import VehicleState

CRITICAL_SEVERITY, WARNING_SEVERITY = 2, 4
"""MAV_SEVERITY; what is less severe than a warning stays in the log."""
AGAIN_S = 30.0
"""A text that a vehicle repeats is shown once in this time; ArduPilot says the same for every item of an upload."""
WINDOW_S = 10.0


class TextRank(IntEnum):
    """How much a text matters."""

    IMPORTANT = 0
    """Critical, or about a failsafe or a crash."""
    WARNING = 1
    ABOARD = 2
    """Of a component that is not the autopilot, whatever it calls it."""


MOST_LINES = {TextRank.IMPORTANT: 12, TextRank.WARNING: 6, TextRank.ABOARD: 3}
"""In a window, of each rank by itself: what matters less takes no room from what matters more."""


def show_text(state: FleetState, vehicle: VehicleState, text: TextMessage, now_s: float) -> Stepped:
    """Take a text of a vehicle's autopilot, or of something else on board, which is shown and nothing more."""
    alarmed = isinstance(text, StatusText) and vehicle.telemetry.alarm[1] == now_s
    if text.severity > WARNING_SEVERITY and not alarmed:
        return state, ()
    if isinstance(text, ComponentText):
        said = link.COMPONENT_TEXT.say(vehicle=vehicle.name, component=text.component, text=text.text)
        return _show_line(state, vehicle, TextRank.ABOARD, said, now_s)
    rank = TextRank.IMPORTANT if alarmed or text.severity <= CRITICAL_SEVERITY else TextRank.WARNING
    return _show_line(state, vehicle, rank, link.TEXT.say(vehicle=vehicle.name, text=text.text), now_s)


def report_suppressed_texts(context: Scene, state: FleetState, now_s: float) -> Stepped:  # noqa: ARG001
    """Say how many texts were passed over, once their window has ended."""
    commands: list[Command] = []
    for vehicle in state.vehicles.values():
        if vehicle.telemetry.texts.passed_over and now_s - vehicle.telemetry.texts.since_s >= WINDOW_S:
            flow, more = _begin_window(vehicle, now_s)
            state = state.put(vehicle.with_telemetry(texts=flow))
            commands += more
    return state, tuple(commands)


def _show_line(state: FleetState, vehicle: VehicleState, rank: TextRank, said: Say, now_s: float) -> Stepped:
    flow, commands = vehicle.telemetry.texts, list[Command]()
    if now_s - flow.since_s >= WINDOW_S:
        flow, commands = _begin_window(vehicle, now_s)
    if _strip_number(said.text) == _strip_number(flow.last[0]) and now_s - flow.last[1] <= AGAIN_S:
        flow = replace(flow, last=(said.text, now_s))
    elif flow.shown[rank] >= MOST_LINES[rank]:
        flow = replace(flow, passed_over=flow.passed_over + 1)
    else:
        shown = tuple(count + (other == rank) for other, count in enumerate(flow.shown))
        flow = replace(flow, last=(said.text, now_s), shown=shown)
        commands.append(said)
    return state.put(vehicle.with_telemetry(texts=flow)), tuple(commands)


def _strip_number(line: str) -> str:
    """Return a line without the number behind it: ArduPilot's "Potential Thrust Loss (3)" names another motor by turns.

    >>> _strip_number("uav2 says: Potential Thrust Loss (3)")
    'uav2 says: Potential Thrust Loss'
    """
    return re.sub(r" \(\d+\)$", "", line)


def _begin_window(vehicle: VehicleState, now_s: float) -> tuple[TextWindow, list[Command]]:
    """Begin a window; say what was passed over in the last one."""
    flow = vehicle.telemetry.texts
    count, took_s = flow.passed_over, now_s - flow.since_s
    said = link.MORE_TEXTS.say(vehicle=vehicle.name, texts=format_count(count, "more text"), time_s=took_s)
    return TextWindow(flow.last, now_s), [said] if count else []
