"""One step at a time: a state and an event in, and everything that comes of them out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from types import MappingProxyType
from typing import Any

from executor.core import fleet_step
from executor.core.context import Context, RelaunchPolicy
from executor.core.interface.commands import Command, Solve, Survivor, Upload
from executor.core.interface.events import Event, IntentReceived, Tick
from executor.core.interface.intents import Action, Intent, IntentRecord, Outcome
from executor.core.interface.messages import Heartbeat
from executor.core.state.fleet_state import FleetState, NewMission, Replan
from executor.core.state.vehicle_parts import HomingOrder, OnboardMission, PositionFix, Takeover
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage, VehicleState
from missions import build_flight_path, continue_path
from tests.executor.builders import flat, vehicle, with_facts
from tests.executor.core.vehicles import AUTO, DISARMED, FLEET, NOW_S, PAD_E, PAD_N, RTL, at, flying

Changes = dict[str, Any]
NOT_SHOWN = frozenset({"vehicles", "watches", "tick_s", "said", "twins"})
"""The memory of the watchpoints and of places has tests of its own, and the others say nothing new here."""
HOLD = 17
LAND = 9
ITS_OFFER = Survivor(
    "uav1",
    (200.0, -5.0),
    73.1078,
    0.999998,
    airborne=True,
    tail=(2,),
    kept=3,
    most_pct=74.1078,
    start_up_m=15.0,
    facing_m=(100.0, 0.0),
)
"""What uav1 of `FLEET` offers to a re-plan from its first leg."""


def flight_of(*vehicles: VehicleState, **facts: Any) -> FleetState:
    """Return a flight that began 100 s ago; who is not given stands on its pad and is not heard."""
    there = {name: vehicle(FLEET, name) for name in FLEET.boards} | {one.name: one for one in vehicles}
    return with_facts(FleetState(MappingProxyType(there)), **({"launched_s": NOW_S - 100.0} | facts))


def changes(before: object, after: object) -> Changes:
    """Return the fields of a dataclass that are others now, with what they are."""
    found: Changes = {}
    held = flat(after)
    for name, was in flat(before).items():
        now = held[name]
        if name not in NOT_SHOWN and was is not now and was != now:
            found[name] = dict(now) if isinstance(now, Mapping) else now
    if all(told == () for told in found.get("told", {}).values()):
        found.pop("told", None)  # nobody was told anything
    return found


def differences(before: FleetState, after: FleetState) -> tuple[Changes, Changes]:
    """Return what changed of each vehicle under its name, and what changed of the flight."""
    ones = {name: changes(one, after.vehicles[name]) for name, one in before.vehicles.items()}
    return {name: found for name, found in ones.items() if found}, changes(before, after)


def rounded(value: Any) -> Any:
    """Return a value with the numbers in it to six digits, so that a table can say them."""
    match value:
        case float():
            return float(f"{value:.6g}") if abs(value) > 1e-6 else 0.0
        case tuple() | list():
            return type(value)(rounded(one) for one in value)
        case Mapping():
            return {name: rounded(one) for name, one in value.items()}
        case OnboardMission() | NewMission() | Upload() | PositionFix():
            return value
        case _ if is_dataclass(value) and not isinstance(value, type):
            told = {one.name: (getattr(value, one.name), rounded(getattr(value, one.name))) for one in fields(value)}
            return replace(value, **{name: now for name, (was, now) in told.items() if was is not now and was != now})
        case _:
            return value


Stepped = tuple[list[Command], Changes, Changes]
"""The commands, what changed of each vehicle under its name, and what changed of the flight."""


def stepped(state: FleetState, event: Event, context: Context = FLEET.context) -> Stepped:
    """Return everything that an event leads to."""
    return outcome(state, fleet_step.step(context, state, event, NOW_S))


def outcome(before: FleetState, of: tuple[FleetState, tuple[Command, ...]]) -> Stepped:
    """Return what a function makes of a flight."""
    after, commands = of
    return rounded((list(commands), *differences(before, after)))  # type: ignore[no-any-return]


@dataclass(frozen=True, slots=True)
class Row:
    """One event, and everything that it leads to."""

    what: str
    one: VehicleState
    """uav1."""
    event: Event
    commands: list[Command]
    vehicles: Changes
    flight: Changes
    given: Changes = field(default_factory=dict)
    """Of the flight; a look is one at a flight that is over, everybody sent home, unless it says otherwise."""
    beside: tuple[VehicleState, ...] = ()
    """Others that do not only stand on their pads."""
    context: Context = FLEET.context

    def shows(self) -> Stepped:
        """Return what the event does lead to."""
        over: Changes = {"recalled": True, "finished": True} if isinstance(self.event, Tick) else {}
        before = flight_of(self.one, *self.beside, **(over | self.given))
        return stepped(before, self.event, self.context)

    def expected(self) -> Stepped:
        """Return what it should lead to."""
        return self.commands, self.vehicles, self.flight


def beat(mode: int = AUTO, *, armed: bool = True, status: int = 4) -> Heartbeat:
    """Return a HEARTBEAT of ArduPilot."""
    return Heartbeat(3, mode, armed, status)


def over_pad(up_m: float = 0.0, *, climbs_m_s: float = 0.0, age_s: float = 0.0, north_m: float = 0.0) -> PositionFix:
    """Return a position over uav1's pad."""
    place_m, velocity_m_s = (PAD_E, PAD_N + north_m), (0.0, 0.0, climbs_m_s)
    return replace(at(up_m=up_m, age_s=age_s), place_m=place_m, velocity_m_s=velocity_m_s)


def landed(**given: Any) -> VehicleState:
    """Return a vehicle that was out there and stands on its pad, its motors off since two seconds."""
    told: Changes = {"heartbeat": DISARMED, "fix": over_pad(), "away_once": True, "disarmed_s": NOW_S - 2.0}
    return flying(**{**told, "waypoint": 5, "anchor": None, **given})


def wish(action: Action, name: str | None = "uav1", *, confirmed: bool = False) -> IntentReceived:
    """Return what an operator asks for on the page."""
    return IntentReceived(Intent("wish", action, name, "page", confirmed))


def wished(action: Action, *waiting: str, **given: Any) -> IntentRecord:
    """Return a wish of ten seconds ago that is under way."""
    return replace(
        IntentRecord(wish(action).intent, Outcome.ACCEPTED, "under way", NOW_S - 10.0, frozenset(waiting)), **given
    )


def noted(
    action: Action, outcome: Outcome, text: str, *waiting: str, name: str | None = "uav1", **given: Any
) -> IntentRecord:
    """Return what is kept of a wish that comes now."""
    intent = wish(action, name, confirmed=given.pop("confirmed", False)).intent
    return replace(IntentRecord(intent, outcome, text, NOW_S, frozenset(waiting)), **given)


def offer_of(name: str = "uav1", *, tail: tuple[int, ...] = (2,), kept: int = 3, airborne: bool = True) -> Survivor:
    """Return what a vehicle offers to a re-plan."""
    return Survivor(name, (300.0, -5.0), 60.0, 1.0, airborne, tail, kept)


def plan_of(*offers: Survivor, **given: Any) -> Replan:
    """Return a re-plan that was solved three seconds ago."""
    solve = Solve(4, (2, 3, 4), offers or (offer_of(),), "uav3: gone")
    return replace(Replan(solve, NOW_S - 5.0, solve_s=0.5, solved_s=NOW_S - 3.0), **given)


def new_mission(*visits: int, fresh: bool = False) -> NewMission:
    """Return what goes on board uav1: its first visit stays, and others follow; or all of it is new."""
    setup, board = FLEET.context.setup, FLEET.boards["uav1"]
    assert board is not None
    if fresh:
        return NewMission(build_flight_path(setup, "uav1", visits), visits, fresh=True)
    return NewMission(continue_path(setup, board.path, 3, visits), (0, *visits), fresh=False)


CREW = replace(FLEET.context, fly_again=RelaunchPolicy.ASK)
"""Where a crew says when somebody takes off."""
BATTERY_FAULT = Fault(FaultKind.BATTERY, "why", NOW_S - 50.0, FaultCode.BATTERY_LOW)
LOW = over_pad()
STILL = replace(at(up_m=0.0), velocity_m_s=(0.0, 0.0, 0.0))
"""Far from the pad."""
HOMEWARD: Changes = {"stage": Stage.RETURNING, "heartbeat": beat(RTL), "left_s": NOW_S - 50.0}
TOLD_HOME: Changes = {
    "ordered_mode_s": NOW_S, "ordered_modes": frozenset({RTL, LAND}), "errand": HomingOrder(NOW_S, told=True)
}  # fmt: skip
LEAVES: Changes = {"stage": Stage.RETURNING, "left_s": NOW_S, "ordered_mode_s": NOW_S, "anchor": None}
SENT_HOME = LEAVES | TOLD_HOME
FAILS = flying(heartbeat=beat(status=8))
TERMINATED = Fault(FaultKind.INTERRUPTION, "reports that its flight is terminated", NOW_S, FaultCode.TERMINATED)
WHY: Changes = {"trigger": "uav1: interruption, reports that its flight is terminated", "trigger_s": NOW_S}
URGENT = {"urgent": True} | WHY
TAKEN = Takeover(NOW_S - 10.0)
SECOND = with_facts(flying(), name="uav2", board=FLEET.boards["uav2"])
"""Another one that flies its mission."""
