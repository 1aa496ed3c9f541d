"""The watchpoints where no plan is known."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.faults.watching import Verdict, View
from executor.core.messages import Heartbeat
from tests.executor.core.faults.looks import point
from tests.executor.core.vehicles import CONTEXT, DISARMED, LOW_TEXT, NOW_S, RTL, SETUP, at, flying, pack

UNPLANNED = replace(SETUP, planned=False)
LOITER, LAND = 5, 9


def unplanned(name: str, **changes: object) -> Verdict:
    """Look at a vehicle of which nobody knows the plan, as a recorded one."""
    state = flying(**({"flew_mission": True, "mode_since_s": NOW_S - 60.0} | changes))
    return point(name).judge(View(CONTEXT, UNPLANNED, state, False, NOW_S)).verdict


def rtl(**changes: object) -> dict[str, object]:
    return {"heartbeat": Heartbeat(3, RTL, True, 4), **changes}


UNPLANNED_ROWS: list[tuple[str, dict[str, object], Verdict]] = [
    ("mode", rtl(), Verdict.FAIL),
    ("mode", rtl(flew_mission=False), Verdict.OK),
    ("mode", rtl(heartbeat=Heartbeat(3, RTL, False, 4)), Verdict.OK),
    ("mode", rtl(ordered_mode_s=NOW_S - 2.9), Verdict.OK),
    ("mode", rtl(ordered_mode_s=NOW_S - 3.0), Verdict.FAIL),
    ("mode", rtl(ordered_mode_s=NOW_S - 62.9), Verdict.OK),
    ("mode", rtl(ordered_mode_s=NOW_S - 63.0), Verdict.FAIL),
    # ArduPilot counts its home: of 10 items the last is 10, and a return there begins with the last but one.
    ("mode", rtl(item=(9, 10)), Verdict.OK),
    ("mode", rtl(item=(8, 10)), Verdict.FAIL),
    ("mode", rtl(item=(9, 65535)), Verdict.FAIL),
    ("mode", rtl(item=(65535, 65535)), Verdict.FAIL),
    ("mode", rtl(item=(9, None)), Verdict.FAIL),
    ("mode", {"heartbeat": Heartbeat(3, LOITER, True, 4), "item": (9, 10)}, Verdict.FAIL),
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
    ("battery-failsafe", {"alarm": LOW_TEXT}, Verdict.FAIL),
    ("heartbeat", {"heartbeat_s": NOW_S - 99.0}, Verdict.STALE),
    ("battery-critical", {"battery": pack(20.0, charge_state=3), "fix": at(age_s=99.0)}, Verdict.FAIL),
    ("link", {"heartbeat_s": NOW_S - 99.0, "fix": at(age_s=99.0)}, Verdict.OK),
]


@pytest.mark.parametrize(("name", "changes", "expected"), UNPLANNED_ROWS)
def test_where_no_plan_is_known(name: str, changes: dict[str, object], expected: Verdict) -> None:
    assert unplanned(name, **changes) is expected
