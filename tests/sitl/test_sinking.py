"""A real autopilot that loses thrust sinks in its mission: it is declared before it lies, and nothing is commanded."""

from __future__ import annotations

from pathlib import Path

import pytest

from missions import dialect_for
from tests.e2e.flights import began_unix_s
from tests.e2e.tlog import messages
from tests.sitl.flights import SPEEDUP, VICTIM, Flown, Story, flown
from tests.sitl.real import BOTH, Autopilot, RealVehicle
from tests.sitl.verdict import ended_well

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(900)]

BELOW_M = 5.0
SOON_S = 5.0


def weaken(vehicle: RealVehicle) -> None:
    """Take thrust away until it cannot hover."""
    if vehicle.other.bytewise:
        vehicle.set("SIH_T_MAX", 1.9)  # of each of four rotors, in newtons, for a kilogram
    else:
        vehicle.set("SIM_ENGINE_MUL", 0.57)
        vehicle.set("SIM_ENGINE_FAIL", 15.0)  # all four


def below_s(flight: Flown) -> float:
    """Return when it was 5 m below where it lost its thrust, by the flight's clock."""
    began_s, struck_s = began_unix_s(flight.run), flight.struck_s or 0.0
    ups = [
        ((stamp_s - began_s) * SPEEDUP, fix.relative_alt / 1e3)
        for stamp_s, fix in messages(flight.run / f"{VICTIM}.tlog", "GLOBAL_POSITION_INT")
    ]
    held_m = [up_m for at_s, up_m in ups if at_s <= struck_s][-1]
    return next(at_s for at_s, up_m in ups if at_s > struck_s and up_m <= held_m - BELOW_M)


@BOTH
def test_it_is_declared_before_it_lies(autopilot: Autopilot, tmp_path: Path) -> None:
    flight = flown(autopilot, Story(weaken), tmp_path)
    ended_well(flight, ["interruption"], down=("uav1", "uav3"))
    [fault] = flight.report["faults"]
    assert fault["code"] in {"sinking", "falling"}, flight.said  # ArduPilot's simulated frame has little drag
    declared_s = fault["detected_s"] + flight.launched_s
    assert declared_s - below_s(flight) <= SOON_S, flight.said
    down_s = flight.says(f"{VICTIM}: does not move, down at")
    assert down_s is not None, flight.said
    assert declared_s < down_s
    home = dialect_for(autopilot.name).modes.return_home.custom_mode
    assert home not in {mode for _, _, mode in flight.heartbeats(VICTIM)}, flight.said
