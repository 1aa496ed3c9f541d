"""Two real vehicles with one system id behind one radio: the checklist reports it, and nothing is changed on board."""

from __future__ import annotations

import asyncio
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mav

from executor.core.interface.codes import Severity
from executor.errors import PreflightFailed
from executor.flight import run_flight
from executor.flight.run_start import FlightRequest, write_run_start
from executor.simulated.simulated_fleet import build_demo_site
from executor.site import site_model
from executor.site.site_file import check_site
from tests.benchmarks.virtual.short_line import shared, write_line
from tests.sitl.flights import Story, WatchfulConsole
from tests.sitl.radio import RadioRelay, slowed
from tests.sitl.real import BOTH, PX4, RELAYED, START_REAL_S, Autopilot, Wanted, running

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(590)]

LOCATED_S = 120.0
QUESTIONS = frozenset(
    {"HEARTBEAT", "PING", "PARAM_REQUEST_READ", "MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_ACK"}
)
COMMANDS = frozenset({mav.MAV_CMD_SET_MESSAGE_INTERVAL, mav.MAV_CMD_REQUEST_MESSAGE, mav.MAV_CMD_RUN_PREARM_CHECKS})
"""They change nothing that outlives the link."""


class OneDevice(RadioRelay):
    """All vehicles come out of one radio at the ground station, as at one serial port."""

    def __init__(self, vehicle_ports: range, station_port: int, profile: str) -> None:
        """Open the vehicles' ports."""
        super().__init__(vehicle_ports, range(station_port, station_port + len(vehicle_ports)), profile)
        self.sent = Counter[str]()
        """What the ground station sent: names of messages, and the numbers of commands."""
        self.armed = False
        """Whether any vehicle was."""
        self.located: set[int] = set()
        """The vehicles that know where they are."""

    def wait_until_located(self, patience_s: float) -> None:
        """Ask everybody for positions until all have said theirs."""
        until_s, codec = time.monotonic() + patience_s, mav.MAVLink(None, 255, 190)
        ask = mav.MAVLink_command_long_message(1, 1, mav.MAV_CMD_SET_MESSAGE_INTERVAL, 0, 33, 1e6, 0, 0, 0, 0, 0)
        while len(self.located) < len(self._to_vehicles):
            assert time.monotonic() < until_s, f"only {self.located} know where they are"
            self._to_vehicles[0].sendto(ask.pack(codec), self._to_station[0].getsockname())
            time.sleep(1.0)
        self.sent.clear()

    def _hand_over(self, vehicle: int, data: bytes, *, up: bool) -> None:
        if not up:
            for one in _parse(data):
                self.armed |= one.get_type() == "HEARTBEAT" and bool(one.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED)
                if one.get_type() == "GLOBAL_POSITION_INT" and one.lat:
                    self.located.add(vehicle)
        super()._hand_over(vehicle if up else 0, data, up=up)

    def _count(self, vehicle: int, data: bytes) -> None:
        self.sent.update(
            str(one.command) if one.get_type() == "COMMAND_LONG" else one.get_type() for one in _parse(data)
        )


def _parse(data: bytes) -> list[Any]:
    parser = mav.MAVLink(None)
    parser.robust_parsing = True
    return parser.parse_buffer(data) or []


@BOTH
def test_two_vehicles_with_one_number_are_refused_in_one_line(autopilot: Autopilot, tmp_path: Path) -> None:
    if autopilot.binary is None:
        pytest.skip(f"{autopilot.variable}: expected the path of a real {autopilot.name}")
    port = autopilot.port + RELAYED
    site = build_demo_site(
        network=write_line(tmp_path / "line.geojson"), radius_m=1e6, vehicles=1, speedup=1.0,
        autopilot=autopilot.name, ports=range(port, port + 1),
    )  # fmt: skip
    site |= {"flight": {"connect_timeout_s": 120.0, "ready_timeout_s": 240.0}, "link": {"one_radio": True}}
    ground = site_model.load_site_model(check_site(site, "test"), tmp_path)
    [pad] = ground.setup.pads
    pads = {"uav1": pad, "other": replace(pad, vehicle="other", east_m=pad.east_m + 6.0)}
    wanted = Wanted(pads, ground.network.frame, 1.0, {}, frozenset(), numbers={"other": 1})
    order = FlightRequest(ground.site, tmp_path, ground, shared(ground), tmp_path / "run", lambda _: ())
    order.run.mkdir()
    write_run_start(order)
    console = WatchfulConsole(Story())
    radio = OneDevice(range(autopilot.port, autopilot.port + 2), port, "sik")
    with radio.running(), running(autopilot, Path(autopilot.binary), tmp_path / "work", wanted) as vehicles:
        other = vehicles["other"]
        other.end()
        other.begin_again()  # nobody switches two vehicles on in the same second
        if autopilot is PX4:
            other.set("MAV_SYS_ID", 1, START_REAL_S)
            for number, name in enumerate(vehicles):
                slowed(number, tmp_path / "work" / name)
        radio.wait_until_located(LOCATED_S)
        with pytest.raises(PreflightFailed, match="uav1: two vehicles"):
            asyncio.run(run_flight.run_flight(order, console))
    stops = [line for line in console.lines if line.startswith(Severity.STOP.value)]
    print(stops, dict(radio.sent))
    assert len(stops) == 1
    assert not radio.armed
    assert {one for one in radio.sent if not one.isdigit()} <= QUESTIONS
    assert {int(one) for one in radio.sent if one.isdigit()} <= COMMANDS
