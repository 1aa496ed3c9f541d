"""A vehicle of a fleet at one moment, made by hand: on its mission, and well, unless it is said otherwise."""

from __future__ import annotations

from executor.core.battery import account
from executor.core.battery.account import BatteryState
from executor.core.battery.pack_condition import PackState
from executor.core.battery.voltage import SagEstimate, VoltageState
from executor.core.interface.messages import Heartbeat
from executor.core.state.vehicle_parts import OnboardMission, PositionFix
from executor.core.state.vehicle_state import Stage, VehicleState
from executor.core.telemetry.mode_evidence import parse_failure_text
from tests.executor.builders import fleet_of, vehicle

FLEET = fleet_of()
CONTEXT, SETUP = FLEET.context, FLEET.context.vehicles["uav1"]
LIMITS = CONTEXT.limits
NOW_S = 1000.0
AUTO, RTL = 3, 6
PAD_E, PAD_N = SETUP.pad_m


OUT_THERE, ON_PAD = "49.60014, 15.60362 (GPS not reported)", "49.60014, 15.59947 (GPS not reported)"
"""Where `at` is, and the pad, in words."""


def at(
    *, east_m: float = 300.0, north_m: float = 0.0, up_m: float = 20.0, climbs_m_s: float = 0.0, age_s: float = 0.0
) -> PositionFix:
    heard_s = NOW_S - age_s
    return PositionFix(heard_s, heard_s, (PAD_E + east_m, PAD_N + north_m), up_m, 450.0 + up_m, (3.0, 0.0, climbs_m_s))


def pack(*percents: float, apart_s: float = 1.0, age_s: float = 0.0, charge_state: int = 1) -> BatteryState:
    """Return a battery with these reports, the last one `age_s` ago; the model expects hardly anything."""
    state = BatteryState()
    for index, percent in enumerate(percents):
        reported_s = NOW_S - age_s - (len(percents) - 1 - index) * apart_s
        state = account.apply_remaining_report(
            account.add_modelled_use(state, 0.036 * apart_s), percent, charge_state, reported_s
        )
    return state


def volts(voltage_v: float = 15.0, usual_v: float = 15.2, age_s: float = 0.0, **changes: object) -> VoltageState:
    """Return a pack of four cells whose current is known."""
    drop = 1.0 - voltage_v / usual_v
    told: dict[str, object] = {
        "reported_s": NOW_S - age_s,
        "voltage_v": voltage_v,
        "highest_v": 16.8,
        "usual_v": usual_v,
        "known_load": True,
        "drop": drop,
        "dropped_s": NOW_S - age_s if drop > LIMITS.voltage_step / 2 else None,
    }
    return VoltageState(**(told | changes))  # type: ignore[arg-type]


def nearly_empty() -> PackState:
    """Return a pack whose four cells rest at 3.65 V under their load."""
    return PackState(sag=SagEstimate(14.5, 0.02, 1e-4, 0.0, 1e-6, NOW_S, 20.0), loaded_s=NOW_S)


def flying(**changes: object) -> VehicleState:
    """Return a vehicle in the midst of its mission, with nothing wrong."""
    healthy: dict[str, object] = {
        "stage": Stage.FLYING,
        "heard_s": NOW_S,
        "heartbeat": Heartbeat(3, AUTO, True, 4),
        "heartbeat_s": NOW_S,
        "item_s": NOW_S,
        "armed_once": True,
        "took_off": True,
        "fix": at(),
        "anchor": at(),
        "battery": pack(90.0, 90.0),
        "volts": volts(),
        "told_s": NOW_S,
        "waypoint": 2,
    }
    return vehicle(FLEET, "uav1", **(healthy | changes))


def mission() -> OnboardMission:
    """Return what it carries."""
    board = flying().assignment.board
    assert board is not None
    return board


DISARMED = Heartbeat(3, AUTO, False, 3)
LOW_TEXT = ("Battery Failsafe", NOW_S)


def says(text: str, at_s: float = NOW_S, **changes: object) -> dict[str, object]:
    """Return what is known of a vehicle that said something of a failure, besides other changes."""
    failed = parse_failure_text(text, low_acts=True)
    return {"alarm": (text, at_s), "failed": () if failed is None else ((failed, at_s),)} | changes
