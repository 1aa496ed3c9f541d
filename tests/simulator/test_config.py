"""Vehicles and fleets that cannot be simulated are refused in one line."""

from __future__ import annotations

import pytest

from simulator.config import AutopilotKind, Endpoint, SimFleet, parse_vehicle_endpoint
from simulator.errors import EndpointError, FaultSpecError, FleetError
from simulator.fault_kinds import parse_fault
from simulator.params import defaults_for
from tests.simulator.harness import sim_vehicle


@pytest.mark.parametrize(
    ("connection", "endpoint"),
    [
        ("udpin://127.0.0.1:14550", Endpoint(("127.0.0.1", 0), ("127.0.0.1", 14550))),
        ("udpin://0.0.0.0:14550", Endpoint(("127.0.0.1", 0), ("127.0.0.1", 14550))),
        ("udpin://localhost:14550", Endpoint(("127.0.0.1", 0), ("127.0.0.1", 14550))),
        ("udpin://192.168.1.7:14550", Endpoint(("0.0.0.0", 0), ("192.168.1.7", 14550))),  # noqa: S104
        ("udpout://127.0.0.1:14551", Endpoint(("127.0.0.1", 14551), None)),
    ],
)
def test_the_vehicle_takes_the_other_side_of_the_ground_stations_link(connection: str, endpoint: Endpoint) -> None:
    assert parse_vehicle_endpoint(connection) == endpoint


@pytest.mark.parametrize(
    "connection",
    ["", "udp://127.0.0.1:14550", "serial:///dev/ttyUSB0:57600", "tcpin://127.0.0.1:5760", "udpin://127.0.0.1",
     "udpin://127.0.0.1:0", "udpin://127.0.0.1:99999", "udpin://127.0.0.1:²", "udpout:127.0.0.1:14550"],
)  # fmt: skip
def test_another_connection_is_refused_in_one_line(connection: str) -> None:
    with pytest.raises(EndpointError) as caught:
        parse_vehicle_endpoint(connection)
    assert "expected udpin://HOST:PORT or udpout://HOST:PORT" in str(caught.value)
    assert repr(connection) in str(caught.value)


def test_an_unknown_parameter_is_named() -> None:
    vehicle = sim_vehicle(AutopilotKind.PX4, parameters={"RTL_ALT": 1500})
    with pytest.raises(FleetError, match="no parameter 'RTL_ALT', expected one of BAT1_CAPACITY"):
        defaults_for(vehicle, 5000)


def test_vehicles_must_be_distinguished_by_where_they_listen() -> None:
    one = sim_vehicle(AutopilotKind.PX4)
    with pytest.raises(FleetError, match=r"connection udpout://127\.0\.0\.1:14550"):
        SimFleet((one, sim_vehicle(AutopilotKind.PX4, name="uav2", sysid=12)))


def test_several_vehicles_may_call_one_port() -> None:
    vehicles = tuple(
        sim_vehicle(AutopilotKind.PX4, name=f"uav{number}", sysid=number, connection="udpin://127.0.0.1:14550")
        for number in (1, 2, 3)
    )
    assert len(SimFleet(vehicles).vehicles) == 3


def test_a_fault_of_an_unknown_vehicle_is_refused() -> None:
    with pytest.raises(FaultSpecError, match="no vehicle 'uav9', expected one of all, uav1"):
        SimFleet((sim_vehicle(AutopilotKind.PX4),), faults=(parse_fault("uav9:crash@0s"),))
