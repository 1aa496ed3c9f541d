"""Real autopilots fly the default network: FAULTLINE_ARDUCOPTER and FAULTLINE_PX4 name their binaries.

Every flight is judged by its telemetry logs, whatever the program itself says of it.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import httpx
import pytest

from missions import dialect_for
from tests.e2e.flights import demo
from tests.ports import free_port
from tests.sitl.flights import VICTIM, Flown, Story, flown
from tests.sitl.real import ARDUPILOT, BOTH, NO_FAILSAFE, PX4, Autopilot, RealVehicle
from tests.sitl.verdict import ended_well

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(900)]

SILENCE_S = 20.0


def shape(value: object) -> object:
    """Return the keys of a report, of its first rows too.

    A last fix is there where the position is reckoned: PX4's estimator may give up its absolute one once it has landed.
    """
    if isinstance(value, dict):
        return {key: None if key == "last_fix" else shape(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [shape(entry) for entry in value[:1]]
    return None


@BOTH
def test_nothing_happens(autopilot: Autopilot, tmp_path: Path) -> None:
    flight = flown(autopilot, Story(), tmp_path)
    ended_well(flight, [])
    assert flight.report["replans"] == []
    assert flight.report["not_counted"] == []


@BOTH
def test_one_falls_silent_for_good(autopilot: Autopilot, tmp_path: Path) -> None:
    flight = flown(autopilot, Story(RealVehicle.suspend, radius_m=400.0), tmp_path)
    ended_well(flight, ["link"], down=("uav1", "uav3"))
    assert len(flight.report["replans"]) == 1, flight.said
    # The same loss on faultline's own simulated fleet.
    simulated = asyncio.run(demo(tmp_path / "simulated", "uav2:silent@40%", speedup=8.0))
    ours, theirs = shape(flight.report), shape(simulated.report)
    assert isinstance(ours, dict)
    assert isinstance(theirs, dict)
    # A flight in which nothing had to be passed over has no row to show there.
    assert {**ours, "not_counted": []} == {**theirs, "not_counted": []}


def drain(vehicle: RealVehicle) -> None:
    """Let a battery give ten times as much as before, by what the vehicle itself measures."""
    if vehicle.other.bytewise:
        vehicle.set("SIM_BAT_DRAIN", 300.0)
    else:
        vehicle.set("BATT_AMP_PERVLT", 170.0)


def asks(port: int, action: str) -> Callable[[RealVehicle], None]:
    """Return how an operator asks something of uav2 on the page."""
    body = {"id": f"story-{action}", "action": action, "vehicle": VICTIM}

    def ask(_: RealVehicle) -> None:
        # The flight's loop answers, so it must not wait here.
        threading.Thread(target=httpx.post, args=(f"http://127.0.0.1:{port}/intents",), kwargs={"json": body}).start()

    return ask


@BOTH
def test_one_holds_and_continues(autopilot: Autopilot, tmp_path: Path) -> None:
    """What it was inspecting counts: it neither repeats nor skips a part, and flies on no faster than before."""
    port = free_port()
    story = Story(asks(port, "hold"), asks(port, "resume"), lasts_s=30.0, page=port)
    flight = flown(autopilot, story, tmp_path)
    ended_well(flight, [])
    assert flight.says(f"{VICTIM}: holds") is not None, flight.said
    assert flight.says(f"{VICTIM}: flies on") is not None, flight.said
    hold = dialect_for(autopilot.name).modes.hold.custom_mode
    held_s = [at_s for at_s, armed, mode in flight.heartbeats(VICTIM) if armed and mode == hold]
    assert held_s[-1] - held_s[0] >= 20.0 / story.speedup
    assert flight.report["not_counted"] == [], flight.said
    assert flight.report["replans"] == [], flight.said


@BOTH
def test_a_battery_drains(autopilot: Autopilot, tmp_path: Path) -> None:
    flight = flown(autopilot, Story(drain), tmp_path)
    ended_well(flight, ["battery"])
    [fault] = flight.report["faults"]
    assert flight.struck_s is not None
    assert 0.0 < fault["detected_s"] + flight.launched_s - flight.struck_s <= 60.0, flight.said
    assert flight.says(f"{VICTIM}: returns") is not None, flight.said


@BOTH
def test_silent_and_home_by_its_own_failsafe(autopilot: Autopilot, tmp_path: Path) -> None:
    """Its segments are given away after it has turned back; heard again, it is left to its return.

    Its patience is eight seconds, two of the computer's.
    """
    patience = {
        ARDUPILOT: {"FS_GCS_ENABLE": 1, "FS_GCS_TIMEOUT": 8},
        PX4: {"NAV_DLL_ACT": 2, "COM_DL_LOSS_T": 8, "COM_FAIL_ACT_T": 1},
    }
    flight = flown(autopilot, silence(patience[autopilot]), tmp_path)
    ended_well(flight, ["link"])
    home = {mode.custom_mode for mode in homeward(autopilot)}
    turned_s = next(at_s for at_s, mode in flight.unseen_modes if mode in home)
    assert turned_s < flight.report["faults"][0]["detected_s"] + flight.launched_s, flight.said
    assert flight.says(f"{VICTIM}: link regained, returning or landing by itself") is not None, flight.said
    assert never_on_its_mission(flight, autopilot)


@BOTH
def test_link_lost_and_given_rtl(autopilot: Autopilot, tmp_path: Path) -> None:
    """Without a failsafe of its own it flies its mission on in silence, until it is heard again."""
    flight = flown(autopilot, silence(NO_FAILSAFE[autopilot], link_timeout_s=14.0), tmp_path)
    ended_well(flight, ["link"])
    assert {mode for _, mode in flight.unseen_modes} == {dialect_for(autopilot.name).modes.mission.custom_mode}
    told_s = flight.says(f"{VICTIM}: link regained; its segments were reassigned, its mission is not resumed")
    assert told_s is not None, flight.said
    assert never_on_its_mission(flight, autopilot, after_s=told_s + 5.0)


@BOTH
def test_a_silence_within_its_patience(autopilot: Autopilot, tmp_path: Path) -> None:
    """Nobody is lost; what it flew unseen counts where clock, place and mission fit, or is flown again.

    Forty seconds are what PX4's start script sets at four times real time.
    """
    patience = {ARDUPILOT: {"FS_GCS_ENABLE": 1, "FS_GCS_TIMEOUT": 40}, PX4: {"NAV_DLL_ACT": 2, "COM_DL_LOSS_T": 40}}
    flight = flown(autopilot, silence(patience[autopilot]), tmp_path)
    ended_well(flight, [], unseen=True)
    assert flight.says(f"{VICTIM}: no message for ") is not None, flight.said
    assert flight.says(f"{VICTIM}: link regained") is not None, flight.said
    assert flight.report["inferred"] or flight.report["replans"], flight.said
    assert all(replan["trigger"].startswith("not proven") for replan in flight.report["replans"]), flight.said
    assert {mode for _, mode in flight.unseen_modes} == {dialect_for(autopilot.name).modes.mission.custom_mode}


@BOTH
def test_through_mavsdk(autopilot: Autopilot, tmp_path: Path) -> None:
    """Two of three are reached through MAVSDK, the one that is lost among them."""
    backends = {"uav1": "mavsdk", VICTIM: "mavsdk"}
    flight = flown(autopilot, Story(RealVehicle.suspend, backends=backends), tmp_path)
    ended_well(flight, ["link"], down=("uav1", "uav3"))
    assert flight.vehicle("uav1")["frames_missing"] is None, "MAVSDK shows no sequence numbers"


def silence(settings: Mapping[str, float], link_timeout_s: float | None = None) -> Story:
    """uav2's link is cut for a while, in which it flies on."""
    faults = {} if link_timeout_s is None else {"link_timeout_s": link_timeout_s}
    return Story(
        RealVehicle.cut, RealVehicle.join, lasts_s=SILENCE_S, settings=settings, faults=faults, relayed=(VICTIM,)
    )


def homeward(autopilot: Autopilot) -> tuple[Any, ...]:
    """The modes in which a vehicle is on its way home, or holds before it turns back."""
    modes = dialect_for(autopilot.name).modes
    return modes.return_home, modes.land, modes.hold


def never_on_its_mission(flight: Flown, autopilot: Autopilot, after_s: float | None = None) -> bool:
    """Return whether uav2 was never heard in the air on its mission again, by default since its link came back."""
    since_s = flight.lifted_s if after_s is None else after_s
    assert since_s is not None
    mission = dialect_for(autopilot.name).modes.mission.custom_mode
    return not [at_s for at_s, armed, mode in flight.heartbeats(VICTIM) if at_s > since_s and armed and mode == mission]
