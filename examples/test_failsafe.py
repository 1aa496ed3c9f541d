"""A failsafe: the client is gone, and the vehicle comes home by itself. A minute and a half of flight, at once."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from examples.client import Client
from simulator.testing import Fleet

HEIGHT_M = 20.0
RETURNS = {"px4": "RETURN", "ardupilot": "RTL"}


@pytest.fixture
def client(simulated_fleet: Fleet) -> Iterator[Client]:
    """Call the first vehicle."""
    calling = Client(simulated_fleet[0].pymavlink, simulated_fleet[0].sysid)
    yield calling
    calling.close()


def order_fleet(autopilot: str, **parameters: float) -> pytest.MarkDecorator:
    """Return the mark of a vehicle with parameters of its own."""
    return pytest.mark.simulated_fleet(autopilot=autopilot, stepped=True, parameters=parameters)


@pytest.mark.parametrize(
    ("autopilot", "patience_s"),
    [
        pytest.param("px4", 8.0, marks=order_fleet("px4", COM_DL_LOSS_T=8, MIS_TAKEOFF_ALT=HEIGHT_M)),
        pytest.param("ardupilot", 12.0, marks=order_fleet("ardupilot", FS_GCS_TIMEOUT=12)),
    ],
)
def test_a_vehicle_without_its_ground_station_returns(
    simulated_fleet: Fleet, client: Client, autopilot: str, patience_s: float
) -> None:
    vehicle = simulated_fleet["uav1"]
    pad = vehicle.truth
    client.take_off(autopilot, HEIGHT_M)
    simulated_fleet.wait_until(lambda: vehicle.truth.up_m > HEIGHT_M - 1, 60, beat=client.beat)
    simulated_fleet.advance(60, beat=client.beat)
    assert "failsafe link" not in vehicle.events, "with a HEARTBEAT a second it stays where it is"

    simulated_fleet.advance(patience_s - 2)
    assert "failsafe link" not in vehicle.events
    simulated_fleet.advance(5)
    assert "failsafe link" in vehicle.events
    simulated_fleet.wait_until(lambda: vehicle.truth.mode == RETURNS[autopilot], 10)
    simulated_fleet.wait_until(lambda: not vehicle.truth.armed, 300)
    assert "landed" in vehicle.events
    there = vehicle.truth
    assert (there.lat_deg, there.lon_deg) == pytest.approx((pad.lat_deg, pad.lon_deg), abs=1e-5)
