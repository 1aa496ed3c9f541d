"""Three real vehicles behind one telemetry radio: a loss, and what the other two are given while they fly."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.e2e.flights import log_lines
from tests.sitl.flights import Flown, Story, flown
from tests.sitl.real import BOTH, Autopilot, RealVehicle
from tests.sitl.verdict import ended_well

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(900)]

RADIO = {"link": {"one_radio": True}}


@BOTH
@pytest.mark.parametrize(
    ("profile", "signed", "within_s"), [("sik", False, 5.0), ("sik-ecc-mended", True, 15.0)], ids=["sik", "signed ecc"]
)
def test_one_falls_silent_and_the_others_have_their_replan(
    autopilot: Autopilot, profile: str, signed: bool, within_s: float, tmp_path: Path
) -> None:
    story = Story(
        RealVehicle.suspend, radius_m=400.0, speedup=1.0, radio=profile, signed=signed, tables={} if signed else RADIO
    )
    flight = flown(autopilot, story, tmp_path)
    took_s = replan_took_s(flight)
    print(f"{autopilot.name} behind {profile}: on board of all survivors {took_s:.1f} s after the solver's answer")
    print("\n".join(line for line in flight.said.splitlines() if "radio" in line))
    ended_well(flight, ["link"], down=("uav1", "uav3"))
    assert len(flight.report["replans"]) == 1, flight.said
    assert flight.report["not_counted"] == []
    assert took_s <= within_s


def replan_took_s(flight: Flown) -> float:
    """Return how long it took from the solver's answer until the last survivor's mission was on board and proven."""
    events = [(line["t_s"], line["event"]) for line in log_lines(flight.run) if "event" in line]
    answered_s = [at_s for at_s, event in events if event["kind"] == "SolveEnded"][-1]
    on_board_s = [at_s for at_s, event in events if event["kind"] == "UploadEnded" and event["accepted"]]
    return float(max(on_board_s) - answered_s)
