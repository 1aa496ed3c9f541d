"""Show vehicles' texts without flooding the crew: a faulty vehicle may send a thousand a second.

All are in the event log. Of those worth a line, a limited number is shown in each time window, the important ones
first, and one line counts the rest.
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
"""MAV_SEVERITY; texts less severe than a warning stay in the log."""
REPEAT_S = 30.0
"""Time within which a repeated text is not shown again; ArduPilot repeats a text for every item of an upload."""
WINDOW_S = 10.0


class TextRank(IntEnum):
    """The importance of a text."""

    IMPORTANT = 0
    """Critical, or about a failsafe or a crash."""
    WARNING = 1
    ABOARD = 2
    """From a component other than the autopilot, whatever its severity."""


MAX_LINES = {TextRank.IMPORTANT: 12, TextRank.WARNING: 6, TextRank.ABOARD: 3}
"""Lines per window for each rank separately, so that less important texts take no room from more important ones."""


def show_text(state: FleetState, vehicle: VehicleState, text: TextMessage, now_s: float) -> Stepped:
    """Apply a text of a vehicle's autopilot, or of another component, whose texts are only shown."""
    alarmed = isinstance(text, StatusText) and vehicle.telemetry.alarm[1] == now_s
    if text.severity > WARNING_SEVERITY and not alarmed:
        return state, ()
    if isinstance(text, ComponentText):
        said = link.COMPONENT_TEXT.say(vehicle=vehicle.name, component=text.component, text=text.text)
        return _show_line(state, vehicle, TextRank.ABOARD, said, now_s)
    rank = TextRank.IMPORTANT if alarmed or text.severity <= CRITICAL_SEVERITY else TextRank.WARNING
    return _show_line(state, vehicle, rank, link.TEXT.say(vehicle=vehicle.name, text=text.text), now_s)


def report_suppressed_texts(context: Scene, state: FleetState, now_s: float) -> Stepped:  # noqa: ARG001
    """Report the number of texts left out, once their window has ended."""
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
    if _strip_number(said.text) == _strip_number(flow.last[0]) and now_s - flow.last[1] <= REPEAT_S:
        flow = replace(flow, last=(said.text, now_s))
    elif flow.shown[rank] >= MAX_LINES[rank]:
        flow = replace(flow, passed_over=flow.passed_over + 1)
    else:
        shown = tuple(count + (other == rank) for other, count in enumerate(flow.shown))
        flow = replace(flow, last=(said.text, now_s), shown=shown)
        commands.append(said)
    return state.put(vehicle.with_telemetry(texts=flow)), tuple(commands)


def _strip_number(line: str) -> str:
    """Return a line without its trailing number: ArduPilot's "Potential Thrust Loss (3)" alternates between motors.

    >>> _strip_number("uav2 says: Potential Thrust Loss (3)")
    'uav2 says: Potential Thrust Loss'
    """
    return re.sub(r" \(\d+\)$", "", line)


def _begin_window(vehicle: VehicleState, now_s: float) -> tuple[TextWindow, list[Command]]:
    """Begin a window; report the texts left out of the last one."""
    flow = vehicle.telemetry.texts
    count, took_s = flow.passed_over, now_s - flow.since_s
    said = link.MORE_TEXTS.say(vehicle=vehicle.name, texts=format_count(count, "more text"), time_s=took_s)
    return TextWindow(flow.last, now_s), [said] if count else []
