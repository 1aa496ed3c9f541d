"""Tests of a client that uploads a mission over UDP: does it keep to the protocol, on a good link and on a bad one."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from examples.client import Client, Place
from simulator.testing import Fleet, FleetVehicle


@pytest.fixture
def client(simulated_fleet: Fleet) -> Iterator[Client]:
    """Call the first vehicle."""
    calling = Client(simulated_fleet[0].pymavlink, simulated_fleet[0].sysid)
    yield calling
    calling.close()


def list_places(vehicle: FleetVehicle, count: int = 3) -> list[Place]:
    """Return places in a row to the north of a vehicle, 100 m apart."""
    here = vehicle.truth
    return [(here.lat_deg + 0.0009 * number, here.lon_deg) for number in range(1, count + 1)]


@pytest.mark.simulated_fleet(stepped=True)
def test_the_mission_is_on_board_and_the_client_did_nothing_wrong(simulated_fleet: Fleet, client: Client) -> None:
    vehicle = simulated_fleet["uav1"]
    places = list_places(vehicle)
    assert client.upload(places) == mavlink.MAV_MISSION_ACCEPTED
    on_board = [(item.x, item.y) for item in vehicle.truth.mission if item.command == mavlink.MAV_CMD_NAV_WAYPOINT]
    assert on_board == [(round(lat_deg * 1e7), round(lon_deg * 1e7)) for lat_deg, lon_deg in places]
    simulated_fleet.check_client()


@pytest.mark.simulated_fleet(stepped=True)
def test_a_refusal_is_told(simulated_fleet: Fleet, client: Client) -> None:
    vehicle = simulated_fleet["uav1"]
    vehicle.inject("refuse-upload")
    assert client.upload(list_places(vehicle)) == mavlink.MAV_MISSION_ERROR
    assert not vehicle.truth.mission


@pytest.mark.simulated_fleet(seed=7, faults=["uav1:delay=0.2@0s", "uav1:duplicate=0.5@0s"])
def test_it_comes_through_a_link_that_is_late_and_says_things_twice(simulated_fleet: Fleet, client: Client) -> None:
    """PX4 asks again after 250 ms, so that some items are asked for several times."""
    assert client.upload(list_places(simulated_fleet["uav1"])) == mavlink.MAV_MISSION_ACCEPTED
    simulated_fleet.check_client(but={"heartbeat"})
