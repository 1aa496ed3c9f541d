"""Hostile moments that were found one by one, flown on both dialects: each is said as what it is, and ends well."""

from __future__ import annotations

import pytest

from executor.core.interface.commands import Level
from tests.stories.story import MISSION
from tests.storm.judge import findings
from tests.storm.plot import ALL, GROUND, Happening, Plot
from tests.storm.sky import Stormed, fly

ROUTES = {"uav1": (0, 2), "uav2": (4,), "uav3": (6,)}
EVERYTHING = {0, 1, 2, 3}
AT_S = 30.0
DIALECTS = pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])

HARMLESS = {
    "a HEARTBEAT that says disarmed": Happening("forged disarmed", "uav2", AT_S, word="1"),
    "a HEARTBEAT of a gimbal": Happening("forged disarmed", "uav2", AT_S, word="190"),
    "a position that cannot be": Happening("forged position", "uav2", AT_S),
    "a text about the battery": Happening("forged text", ALL, AT_S, word="Battery Failsafe"),
    "a radio from elsewhere": Happening("forged radio", "uav2", AT_S),
    "garbage": Happening("garbage", ALL, 10.0, 60.0),
}
TOLD = {
    "no position": (Happening("no position", "uav2", AT_S, 90.0), "uav2: interruption, no position for 20 s"),
    "no heartbeat": (Happening("no heartbeat", "uav2", AT_S, 90.0), "uav2: interruption, no HEARTBEAT for 20 s"),
    "a foreign mission": (Happening("foreign mission", "uav2", AT_S), "uav2: has a foreign mission on board ("),
    "a fence": (Happening("fence", "uav2", AT_S), "uav2: fence, its fence is breached; it says: "),
}


def flown(autopilot: str, *happenings: Happening, spare: bool = False) -> Stormed:
    """Fly it; nothing that was said, counted, commanded or left is untrue."""
    routes = {**ROUTES, "uav4": ()} if spare else ROUTES
    stormed = fly(Plot(1, autopilot, "line", routes, happenings, fly_again="auto"))
    assert findings(stormed) == []
    assert set(stormed.flown.inspected) == EVERYTHING
    return stormed


def faults(stormed: Stormed) -> list[str]:
    return [line.text for _, line in stormed.flown.said if line.level is Level.FAULT]


@DIALECTS
@pytest.mark.parametrize("what", HARMLESS)
def test_no_foreign_frame_ends_a_flight(autopilot: str, what: str) -> None:
    stormed = flown(autopilot, HARMLESS[what])
    assert faults(stormed) == []
    assert not any(line.text.startswith("re-plan") for _, line in stormed.flown.said)


@DIALECTS
@pytest.mark.parametrize("what", TOLD)
def test_what_goes_wrong_is_a_fault_by_its_own_name(autopilot: str, what: str) -> None:
    happening, says = TOLD[what]
    stormed = flown(autopilot, happening)
    assert any(line.startswith(says) for line in faults(stormed)), faults(stormed)


@DIALECTS
def test_a_foreign_mission_is_noticed_within_two_seconds(autopilot: str) -> None:
    stormed = flown(autopilot, TOLD["a foreign mission"][0])
    began_s = next(at_s for at_s, one in stormed.began if one.kind == "foreign mission")
    told_s = next(at_s for at_s, line in stormed.flown.said if "foreign mission" in line.text)
    assert told_s - began_s <= 2.0
    free_s = next(at_s for at_s, line in stormed.flown.said if "its segments are released to the others" in line.text)
    assert free_s - told_s == pytest.approx(30.0, abs=2.0), "they are kept for a while"


@DIALECTS
def test_a_radio_that_is_gone_for_long_ends_no_flight(autopilot: str) -> None:
    """They come home by their own failsafes, are nobody's loss, and finish."""
    stormed = flown(autopilot, Happening("all silent", ALL, AT_S, 75.0))
    [line] = faults(stormed)
    assert line.startswith(
        "no message from any vehicle for 60 s; in the air at last contact: uav1, uav2, uav3. The flight stays"
    )


@DIALECTS
def test_a_solver_that_hangs_is_done_without(autopilot: str) -> None:
    hangs = Happening("solver", GROUND, 10.0, 60.0, word="hangs")
    stormed = flown(autopilot, hangs, Happening("silent", "uav2", AT_S))
    assert sum("the solver did not answer; trying again" in line.text for _, line in stormed.flown.said) >= 1


@DIALECTS
def test_a_kill_switch_on_a_spare_keeps_it_on_the_ground(autopilot: str) -> None:
    stormed = flown(autopilot, Happening("kill", "uav4", AT_S), Happening("crash", "uav2", AT_S + 2.0), spare=True)
    assert "uav4: its kill switch is on; no start until included" in faults(stormed)
    assert not any(one.what == "armed" for one in stormed.flown.truths if one.vehicle == "uav4")


@DIALECTS
def test_a_regained_vehicle_with_reassigned_segments_is_re_planned(autopilot: str) -> None:
    words = MISSION[autopilot]
    taken = Happening("pilot", "uav1", 12.0, 40.0, word=f"{words['hold']} {words['mission']}")
    routes = {"uav1": (0, 2, 4, 6), "uav2": ()}
    stormed = fly(Plot(1, autopilot, "line", routes, (taken,), fly_again="auto", pilot_return="auto"))
    assert findings(stormed) == []
    assert not any("trying again" in line.text for _, line in stormed.flown.said)
    assert sum(line.text.startswith("re-plan 2 found") for _, line in stormed.flown.said) == 1


def test_a_ground_station_that_is_killed_as_the_flight_ends_finds_it_over() -> None:
    """What was found last, that it lies on its back, ended the flight; the same step was the last that was kept."""
    late, wreck = Happening("bursts", "uav1", 60.0, 10.0), Happening("wreck", "uav1", 67.0)
    killed = Happening("ground killed", GROUND, 73.4, 10.0)
    stormed = fly(Plot(8766, "ardupilot", "apart", {"uav1": (2,)}, (late, wreck, killed)))
    assert findings(stormed) == []
    assert stormed.flown.ended_s is not None


def test_a_vehicle_that_used_charge_without_a_link_landed_with_the_rest() -> None:
    silent, emptied = Happening("silent", "uav1", 10.0, 63.6), Happening("emergency", "uav1", 13.2, word="RTL")
    stormed = fly(Plot(1, "ardupilot", "apart", {"uav1": (3, 1)}, (silent, emptied)))
    assert findings(stormed) == []
    assert "uav1: landed with 7 %" in [line.text for _, line in stormed.flown.said]
