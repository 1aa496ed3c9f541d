"""Another ground station joins over `[forward]` in mid-flight, on a radio that it could fill: the flight continues."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mav

from benchmarks.virtual.radio import MemoryRadio, share_port
from benchmarks.virtual_flight import FlightObservers, VirtualFlight, VirtualRun, fly_virtual
from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.forward import StationPort
from executor.core import forwarding
from executor.core.context import Context
from executor.core.fleet_step import FORWARD
from executor.core.interface.connection import parse_connection
from executor.core.lines import link
from executor.core.state.fleet_state import FleetState
from executor.flight.open_links import build_forwarder
from executor.runtime.flight_loop import Flight
from executor.site.flight_keys import ForwardTable, LinkTable
from missions.geo import LocalFrame
from simulator.fleet import SimulatedVehicle
from simulator.radio import parse_radio
from tests.benchmarks.virtual.short_line import shared, short_ground

RADIO = "sik-ecc-mended"
OURS = LinkTable(station_sysid=254)
PORT = "udpin://127.0.0.1:14550"
JOINS_S, EVERY_S = 25.0, 0.25
RTL = 20
TELLS = "the ground station of system 255 component 190 "


class Station:
    """QGroundControl's numbers, and what it asks when it finds vehicles."""

    def __init__(self, say: Callable[[bytes], None], systems: tuple[int, ...]) -> None:
        self._say, self._systems, self._mav = say, systems, mav.MAVLink(None, srcSystem=255, srcComponent=190)
        self._parser = mav.MAVLink(None)
        self.items: list[Any] = []
        """Of a mission that it uploads."""

    def hear(self, frame: bytes) -> None:
        """Give a vehicle the item that it asks for."""
        heard = self._parser.decode(bytearray(frame))
        if heard.get_type().startswith("MISSION_REQUEST"):
            self.send(self.items[heard.seq])

    def send(self, message: Any) -> None:
        self._say(bytes(message.pack(self._mav)))

    def ask_everything(self) -> None:
        self.send(mav.MAVLink_heartbeat_message(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 192, 0, 4, 3))
        for system in self._systems:
            for stream in range(13):
                self.send(mav.MAVLink_request_data_stream_message(system, 1, stream, 4, 1))
            self.send(mav.MAVLink_param_request_list_message(system, 1))
            self.send(mav.MAVLink_command_long_message(system, 1, 512, 0, 148.0, *[0.0] * 6))


def list_items(system: int, depot: LocalFrame) -> list[Any]:
    """Return a mission of a station's own: up, and back home."""
    lat, lon = (round(1e7 * at_deg) for at_deg in (depot.lat_deg, depot.lon_deg))
    places = [(16, lat, lon, 0.0), (22, lat, lon, 40.0), (16, lat + 2000, lon, 40.0), (20, 0, 0, 0.0)]
    return [
        mav.MAVLink_mission_item_int_message(system, 1, seq, 6, command, int(seq == 0), 1, 0, 0, 0, 0, x, y, z)
        for seq, (command, x, y, z) in enumerate(places)
    ]


class StationRun(VirtualRun):
    """A flight that a station joins, which then gives an order."""

    def __init__(self, *arguments: Any, order: Callable[[int], Any] | None = None, **more: Any) -> None:
        super().__init__(*arguments, **more)
        site = self._order.site
        self._joins, self._gives = build_forwarder(site, self.clock), order
        ends = tuple[MemoryRadio, ...](self.radios.values())
        for behind in [ends] if site.link.one_radio else [(end,) for end in ends]:
            share_port(behind, MavlinkCodec(station=site.link.station), self._joins.tap)
        self._joins.links.update({radio.sysid: radio.link for radio in self.radios.values()})
        self.seen, self.silence_s = 0, 0.0

    async def _supervise(self, context: Context, state: FleetState, until_s: float) -> tuple[Flight, bool]:
        beside = asyncio.create_task(self._stand_beside())
        try:
            return await super()._supervise(context, state, until_s)
        finally:
            beside.cancel()
            with suppress(asyncio.CancelledError):
                await beside

    async def _stand_beside(self) -> None:
        codec = MavlinkCodec(station=self._order.site.link.station)
        port = StationPort(self._joins, codec, parse_connection(PORT))
        systems = tuple(radio.sysid for radio in self.radios.values())
        station = Station(lambda frame: port.route_frames(codec.decode(frame), self._see), systems)
        await asyncio.sleep(JOINS_S)
        self.station = station
        station.items = list_items(systems[0], self._order.ground.network.frame)
        if self._gives is not None:
            station.send(self._gives(systems[0]))
        while True:
            station.ask_everything()
            await asyncio.sleep(EVERY_S)

    def _see(self, frame: bytes) -> bool:
        self.seen += 1
        self.station.hear(frame)
        return True


def flown(
    folder: Path, autopilot: str, order: Callable[[int], Any] | None = None, radio: str = RADIO
) -> tuple[VirtualFlight, StationRun]:
    """Fly, and return the flight with its run, which knows how long a vehicle did not hear us."""
    ground, runs = short_ground(folder, 3, autopilot), list[StationRun]()
    ours = OURS.model_copy(update={"one_radio": parse_radio(radio).profile.shared})
    site = ground.site.model_copy(update={"link": ours, "forward": ForwardTable(to=(PORT,), allow_orders=True)})
    ground = replace(ground, site=site)

    def make(*arguments: Any) -> StationRun:
        runs.append(StationRun(*arguments, order=order, radio=radio))
        return runs[-1]

    def look(vehicles: Mapping[str, SimulatedVehicle]) -> None:
        silences_s = [vehicle.autopilot.gcs_silence_s or 0.0 for vehicle in vehicles.values()]
        runs[-1].silence_s = max(runs[-1].silence_s, *silences_s)

    flight = fly_virtual(ground, shared(ground), seed=1, make=make, onlookers=FlightObservers(lived=look))
    return flight, runs[-1]


def lines(flight: VirtualFlight, part: str) -> list[str]:
    return [line.text for _, line in flight.said if part in line.text]


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_station_that_requests_everything_at_4_hz_is_refused_and_the_flight_continues(
    tmp_path: Path, autopilot: str
) -> None:
    flight, run = flown(tmp_path, autopilot)
    assert flight.ended
    assert flight.report.faults == ()
    assert flight.report.finished
    assert run.seen > 100, "it sees what flies"
    assert run.silence_s < 1.0, "of our own HEARTBEAT"
    assert lines(flight, FORWARD) == [
        f"{FORWARD}: ground station heard, system 255 component 190",
        f"{FORWARD}: {TELLS}{link.WOULD_FILL_RADIO}",
        f"{FORWARD}: {TELLS}{link.MORE_THAN_SHARE}",
    ]


def test_the_same_questions_passed_on_would_have_ended_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The yardstick of the test above: without the rules nobody hears us for seconds, and all come home."""
    monkeypatch.setattr(forwarding.Allowance, "admit", lambda self, *_, **__: (self, None))
    flight, run = flown(tmp_path, "ardupilot")
    assert run.silence_s > 5.0
    assert not flight.report.finished


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_vehicle_that_a_station_orders_home_is_that_stations(tmp_path: Path, autopilot: str) -> None:
    flight, _ = flown(
        tmp_path, autopilot, lambda system: mav.MAVLink_command_long_message(system, 1, RTL, 0, *[0.0] * 7)
    )
    assert flight.ended
    [vehicle, *_] = flight.context.vehicles
    assert lines(flight, f"{vehicle}: {TELLS}") == [f"{vehicle}: {TELLS}sends MAV_CMD_NAV_RETURN_TO_LAUNCH"]
    [taken] = [line for line in lines(flight, "another ground station has ordered it to") if line.startswith(vehicle)]
    assert "not commanded from here" in taken


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_vehicle_that_a_station_gives_its_own_mission_is_that_stations(tmp_path: Path, autopilot: str) -> None:
    flight, _ = flown(tmp_path, autopilot, lambda system: mav.MAVLink_mission_count_message(system, 1, 4))
    assert flight.ended
    [vehicle, *_] = flight.context.vehicles
    assert lines(flight, f"{vehicle}: {TELLS}") == [f"{vehicle}: {TELLS}uploads a mission, 4 items"]
    [taken] = lines(flight, "has a foreign mission on board")
    assert taken.startswith(vehicle)
    assert "not commanded from here" in taken
