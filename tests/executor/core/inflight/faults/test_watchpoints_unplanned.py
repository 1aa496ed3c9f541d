"""The watchpoints where no plan is known."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.inflight.faults.watch_view import WatchView
from executor.core.interface.messages import Actor, Attitude, Heartbeat, ModeChange, OrderSeen, OwnFailsafe
from executor.core.state.vehicle_parts import SwitchMove
from tests.executor.core.inflight.faults.watch_views import Verdict, point, verdict_of
from tests.executor.core.vehicles import CONTEXT, DISARMED, LOW_TEXT, NOW_S, RTL, SETUP, at, flying, pack, says

UNPLANNED = replace(SETUP, planned=False)
LOITER, LAND = 5, 9


def unplanned(name: str, **changes: object) -> Verdict:
    """Look at a vehicle of which nobody knows the plan, as a recorded one."""
    state = flying(**({"flew_mission": True, "mode_since_s": NOW_S - 60.0} | changes))
    return verdict_of(point(name).judge(WatchView(CONTEXT, UNPLANNED, state, False, NOW_S)))


def rtl(**changes: object) -> dict[str, object]:
    return {"heartbeat": Heartbeat(3, RTL, True, 4), **changes}


def by_hand(**changes: object) -> dict[str, object]:
    return {"heartbeat": Heartbeat(3, LOITER, True, 4), **changes}


CHANGED_S = NOW_S - 60.0
SINKS = at(up_m=20.0, climbs_m_s=-6.0)


def ordered(mode: int | None, late_s: float) -> tuple[tuple[OrderSeen, float], ...]:
    return ((OrderSeen(176, mode), CHANGED_S + late_s),)


def moved(late_s: float) -> tuple[SwitchMove, ...]:
    return (SwitchMove(5, 1430, 1682, CHANGED_S + late_s - 0.5, CHANGED_S + late_s),)


def passed(said_s: float, over_s: float) -> tuple[tuple[OwnFailsafe, float, float], ...]:
    return ((OwnFailsafe("fence", active=True, words="fence breached"), NOW_S + said_s, NOW_S + over_s),)


UNPLANNED_ROWS: list[tuple[str, dict[str, object], Verdict]] = [
    ("mode", rtl(), Verdict.FAIL),
    ("mode", rtl(flew_mission=False), Verdict.OK),
    # A breach that was over before the mode was heard; whatever was over long before explains nothing.
    ("mode", rtl(mode_since_s=NOW_S - 5.0, passed=passed(-5.1, -5.0)), Verdict.OK),
    ("fence", rtl(mode_since_s=NOW_S - 5.0, passed=passed(-5.1, -5.0)), Verdict.FAIL),
    ("fence", rtl(mode_since_s=NOW_S - 5.0, passed=passed(-9.0, -7.1)), Verdict.OK),
    ("fence", rtl(mode_since_s=NOW_S - 15.1, passed=passed(-15.2, -15.0)), Verdict.OK),
    ("fence", rtl(mode_since_s=NOW_S - 5.0, breached_s=NOW_S - 9.0), Verdict.FAIL),
    ("fence", rtl(mode_since_s=NOW_S - 5.0, breached_s=NOW_S - 9.1), Verdict.OK),
    ("fence", {"passed": passed(-5.1, -5.0)}, Verdict.OK),
    ("mode", rtl(heartbeat=Heartbeat(3, RTL, False, 4)), Verdict.OK),
    ("mode", rtl(mode_since_s=NOW_S - 4.0), Verdict.FAIL),
    # What may explain it may still be on its way.
    ("mode", rtl(mode_since_s=NOW_S - 3.9), Verdict.OK),
    ("mode", rtl(others_orders=ordered(RTL, -5.0)), Verdict.OK),
    ("mode", rtl(others_orders=ordered(RTL, -5.1)), Verdict.FAIL),
    ("mode", rtl(others_orders=ordered(None, 3.0)), Verdict.OK),
    ("mode", rtl(others_orders=ordered(None, 3.1)), Verdict.FAIL),
    # An order for one mode explains no other.
    ("mode", rtl(others_orders=ordered(LOITER, -1.0)), Verdict.FAIL),
    ("mode", rtl(switched=moved(-2.5)), Verdict.OK),
    ("mode", rtl(switched=moved(-2.6)), Verdict.FAIL),
    ("mode", rtl(recorded=(ModeChange(RTL, Actor.PILOT), CHANGED_S)), Verdict.OK),
    ("mode", rtl(recorded=(ModeChange(RTL, Actor.FAILSAFE), CHANGED_S)), Verdict.FAIL),
    ("mode", rtl(critical_s=CHANGED_S), Verdict.FAIL),
    # By its own name: a battery's failsafe interrupts nothing else.
    ("mode", rtl(**says("Battery Failsafe", CHANGED_S)), Verdict.OK),
    ("mode", rtl(flew_mission=False, **says("EKF Failsafe: changed to Land Mode", CHANGED_S)), Verdict.FAIL),
    ("mode", rtl(flew_mission=False, critical_s=CHANGED_S), Verdict.OK),
    # ArduPilot counts its home: of 10 items the last is 10, and a return there begins with the last but one.
    ("mode", rtl(item=(9, 10)), Verdict.OK),
    ("mode", rtl(item=(8, 10)), Verdict.FAIL),
    ("mode", rtl(item=(9, 65535)), Verdict.FAIL),
    ("mode", rtl(item=(65535, 65535)), Verdict.FAIL),
    ("mode", rtl(item=(9, None)), Verdict.FAIL),
    # Nobody but a person chooses a mode that has to be flown.
    ("mode", {"heartbeat": Heartbeat(3, LOITER, True, 4), "item": (9, 10)}, Verdict.OK),
    ("crash", says("Crash: Disarming: AngErr=40>30, Accel=0.0<3.0"), Verdict.FAIL),
    ("crash", says("Crash: Disarming", NOW_S - 15.1), Verdict.OK),
    ("crash", {"tilted_since_s": NOW_S - 3.0, "attitude": Attitude(100.0, 0.0)}, Verdict.FAIL),
    ("crash", {"tilted_since_s": NOW_S - 2.9, "attitude": Attitude(100.0, 0.0)}, Verdict.OK),
    ("crash", {"tilted_since_s": NOW_S, "attitude": Attitude(100.0, 0.0), "heartbeat": DISARMED}, Verdict.FAIL),
    ("crash", {"tilted_since_s": NOW_S - 9.0, "attitude": Attitude(100.0, 0.0), "took_off": False}, Verdict.OK),
    ("falling", {"fix": SINKS, "last_fix": at(up_m=24.0, age_s=1.0)}, Verdict.FAIL),
    # Its heights refute what its velocity says.
    ("falling", {"fix": SINKS, "last_fix": at(up_m=20.5, age_s=1.0)}, Verdict.OK),
    ("falling", {"fix": SINKS}, Verdict.OK),
    ("falling", {"fix": SINKS, "last_fix": at(up_m=24.0, age_s=1.0), "took_off": False}, Verdict.OK),
    ("falling", by_hand(fix=SINKS, last_fix=at(up_m=24.0, age_s=1.0)), Verdict.OK),
    ("position", {"jump": (150.0, NOW_S)}, Verdict.FAIL),
    ("position", by_hand(jump=(150.0, NOW_S)), Verdict.OK),
    ("stall", {"anchor": at(age_s=239.9)}, Verdict.OK),
    ("stall", {"anchor": at(age_s=240.0)}, Verdict.FAIL),
    ("stall", {"anchor": at(age_s=240.0), "heartbeat": Heartbeat(3, LOITER, True, 4)}, Verdict.OK),
    ("off-pad", {"heartbeat": DISARMED, "fix": at(up_m=5.1, climbs_m_s=-1.5)}, Verdict.FAIL),
    ("off-pad", {"heartbeat": DISARMED, "fix": at(up_m=5.0, climbs_m_s=-1.5)}, Verdict.OK),
    ("off-pad", {"heartbeat": DISARMED, "fix": at(up_m=5.1, age_s=3.0)}, Verdict.FAIL),
    ("off-pad", {"heartbeat": DISARMED, "fix": at(up_m=5.1, age_s=3.1)}, Verdict.OK),
    ("off-pad", {"heartbeat": DISARMED, "fix": at(up_m=5.1), "on_ground": True}, Verdict.OK),
    ("off-pad", {"heartbeat": DISARMED, "fix": replace(at(up_m=9.0), velocity_m_s=(1.0, 0.0, 0.0))}, Verdict.OK),
    ("off-pad", {"heartbeat": DISARMED, "fix": replace(at(up_m=9.0), velocity_m_s=(0.0, 1.1, 0.0))}, Verdict.FAIL),
    ("battery-failsafe", says(LOW_TEXT[0]), Verdict.FAIL),
    ("heartbeat", {"heartbeat_s": NOW_S - 99.0}, Verdict.STALE),
    ("battery-critical", {"battery": pack(20.0, charge_state=3), "fix": at(age_s=99.0)}, Verdict.FAIL),
    ("link", {"heartbeat_s": NOW_S - 99.0, "fix": at(age_s=99.0)}, Verdict.OK),
]


@pytest.mark.parametrize(("name", "changes", "expected"), UNPLANNED_ROWS)
def test_where_no_plan_is_known(name: str, changes: dict[str, object], expected: Verdict) -> None:
    assert unplanned(name, **changes) is expected
