"""Three real vehicles behind one telemetry radio: a loss, and what the other two are given while they fly."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.e2e.flights import log_lines
from tests.sitl.flights import Flown, Story, flown
from tests.sitl.real import ARDUPILOT, PX4, Autopilot, RealVehicle
from tests.sitl.verdict import ended_well

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(900)]

KINDS = [
    # What each radio carries is in docs/how-to/one-radio.md; PX4 1.17 signs nothing.
    pytest.param(ARDUPILOT, "sik", 4000.0, False, 5.0, id="ardupilot, sik"),
    pytest.param(ARDUPILOT, "sik-ecc-mended", 1500.0, True, 15.0, id="ardupilot, sik with ecc, signed"),
    pytest.param(PX4, "sik", 4000.0, False, 5.0, id="px4, sik"),
    pytest.param(PX4, "sik-ecc-mended", 1500.0, False, 15.0, id="px4, sik with ecc"),
]


@pytest.mark.parametrize(("autopilot", "profile", "bytes_s", "signed", "within_s"), KINDS)
def test_one_falls_silent_and_the_others_have_their_replan(
    autopilot: Autopilot, profile: str, bytes_s: float, signed: bool, within_s: float, tmp_path: Path
) -> None:
    radios = {"radios": [{"system": 51, "component": 68}]} if signed else {}
    story = Story(
        RealVehicle.suspend, radius_m=400.0, speedup=1.0, radio=profile, signed=signed,
        tables={"link": {"one_radio": True, "bytes_s": bytes_s, **radios}},
    )  # fmt: skip
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
