"""The package's front door."""

from __future__ import annotations

import missions


def test_the_example_in_the_docstring_holds() -> None:
    network = missions.read_network(missions.default_network_path(), radius_m=700)
    setup = missions.plan_flight_setup(network, ["uav1", "uav2"], missions.Inspection())
    mission = missions.encode(missions.build_flight_path(setup, "uav1", [0, 2, 4]), missions.PX4)
    assert mission.items[0].command is missions.Command.NAV_TAKEOFF
