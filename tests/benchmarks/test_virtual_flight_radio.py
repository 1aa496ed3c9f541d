"""A flight behind one telemetry radio that another ground station fills: it continues, and the crew is informed."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

from benchmarks.virtual_flight import FlightObservers, VirtualRun, fly_virtual
from benchmarks.virtual_site import build_virtual_site
from simulator.fleet import SimulatedVehicle
from tests.benchmarks.virtual.short_line import shared, write_line

JOINS_S = 100.0
"""On the vehicles' clocks."""
ASKED = (
    "ATTITUDE", "VFR_HUD", "LOCAL_POSITION_NED", "SYS_STATUS", "GPS_RAW_INT", "BATTERY_STATUS", "EXTENDED_SYS_STATE",
    "MISSION_CURRENT", "GLOBAL_POSITION_INT", "HOME_POSITION",
)  # fmt: skip
"""What QGroundControl asks for, four times a second."""


def test_another_station_that_fills_the_radio_in_flight_is_named_and_streams_are_thinned(tmp_path: Path) -> None:
    link = {"one_radio": True, "bytes_s": 2500}
    ground = build_virtual_site(write_line(tmp_path / "line.geojson"), None, 3, "ardupilot", tables={"link": link})
    joined: set[str] = set()

    def join(vehicles: Mapping[str, SimulatedVehicle]) -> None:
        for name, vehicle in vehicles.items():
            pilot = vehicle.autopilot
            if pilot.frame.armed and pilot.now_s > JOINS_S and name not in joined:
                joined.add(name)
                for stream in ASKED:
                    pilot.streams.set_interval(stream, 250_000.0, pilot.now_s)

    flight = fly_virtual(
        ground, shared(ground), onlookers=FlightObservers(lived=join), make=partial(VirtualRun, radio="sik-ecc-mended")
    )
    said = [line.text for _, line in flight.said]
    assert any(text.startswith("radio of uav1, uav2, uav3 congested: it carries all that it can") for text in said)
    assert "radio of uav1, uav2, uav3: streams are thinned, positions at 2 Hz" in said
    assert (flight.report.finished, flight.report.faults, flight.report.not_counted) == (True, (), ())
    [radio] = flight.report.radios
    assert radio.vehicles == ("uav1", "uav2", "uav3")
    assert radio.most_bytes_s > 2250.0
    assert radio.congested_s > 0.0
    assert radio.round_trip_s is not None
