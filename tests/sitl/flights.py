"""One flight of real autopilots: three vehicles over the default network, and what happens to one of them."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

from executor.adapters import clock
from executor.core.context import Context
from executor.core.interface.codes import Check
from executor.core.interface.commands import Level
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import Stage, VehicleState
from executor.flight import run_flight
from executor.flight.run_start import FlightRequest, write_run_start
from executor.site import site_model, site_planning
from executor.site.site_file import Site, check_site
from executor.site.site_model import SiteModel
from missions import PlanFile
from planner import Cost
from tests.e2e.flights import began_unix_s, log_lines
from tests.e2e.tlog import messages
from tests.sitl.eye import Eye, all_looking
from tests.sitl.radio import RadioRelay, slowed
from tests.sitl.real import PX4, RELAYED, Autopilot, RealVehicle, Wanted, running

VICTIM = "uav2"
NAMES = ("uav1", VICTIM, "uav3")
KEY, KEY_FILE = bytes(range(32)), "signing.key"
SPEEDUP = float(os.environ.get("FAULTLINE_SITL_SPEEDUP", "4"))
"""Times real time; a busy computer keeps up with less."""


def in_its_second_segment(vehicle: VehicleState, state: FleetState) -> bool:
    """Whether uav2 inspects its second segment."""
    return vehicle.name in state.coverage.inspected.values() and vehicle.assignment.run is not None


@dataclass(frozen=True)
class Prepared:
    """What is flown, where the site alone does not say it."""

    ground: SiteModel
    plan: PlanFile
    at_s: float | None
    """When it happens, since uav2 began its mission; None: when the story says so."""


@dataclass(frozen=True)
class Story:
    """What happens as soon as uav2 inspects its second segment, to uav2 by default, and how everybody is set up."""

    strike: Callable[[RealVehicle], None] | None = None
    lift: Callable[[RealVehicle], None] | None = None
    """What ends it."""
    lasts_s: float = 0.0
    """Of the flight's time, from the one to the other."""
    lift_at: Callable[[VehicleState, FleetState], bool] | None = None
    """When that is, by the state instead of the time."""
    settings: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    """Parameters of every vehicle."""
    struck: tuple[str, ...] = (VICTIM,)
    """Whom it happens to."""
    faults: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    """The site file's table of that name."""
    fence: Mapping[str, object] = field(default_factory=lambda: MappingProxyType({}))
    """The site file's table of that name."""
    relayed: tuple[str, ...] = ()
    """Whose link goes through a relay."""
    radio: str = ""
    """The emulated radio that all vehicles share."""
    signed: bool = False
    """Whether frames are signed, and a SiK radio is named, which cannot sign."""
    backends: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    """Who does not speak to its vehicle by the native link."""
    radius_m: float = 320.0
    """About the depot: seven segments; 400 m are thirteen."""
    speedup: float = SPEEDUP
    page: int = 0
    """The port of the page; 0 for a free one."""
    flight: Mapping[str, object] = field(default_factory=lambda: MappingProxyType({}))
    """More of the site file's table of that name."""
    at: Callable[[VehicleState, FleetState], bool] = in_its_second_segment
    """When it happens."""
    own: Mapping[str, Mapping[str, float]] = field(default_factory=lambda: MappingProxyType({}))
    """Parameters of single vehicles, by their names."""
    packs_ah: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    """What ArduPilot's packs really hold, by their vehicles' names."""
    tables: Mapping[str, object] = field(default_factory=lambda: MappingProxyType({}))
    """More tables of the site file."""
    loses: str = ""
    """Who falls silent for good."""
    loses_at: Callable[[VehicleState, FleetState], bool] = in_its_second_segment
    """When that is, by uav2."""
    eyes: Mapping[str, Eye] = field(default_factory=lambda: MappingProxyType({}))
    """Cameras of PX4's vehicles, by their names."""
    prepared: Callable[[SiteModel], Prepared] | None = None
    """Chooses the batteries, the plan, and when it happens; by default it happens `at`."""


class WatchfulConsole:
    """Keeps what is said, and strikes in mid-segment."""

    def __init__(self, story: Story) -> None:
        """Begin with nobody to strike."""
        self.lines: list[str] = []
        self.running: Mapping[str, RealVehicle] = {}
        self.shown: list[tuple[float, str]] = []
        """What uav2 was taken to do, whenever that changed, by the flight's clock."""
        self.struck_s: float | None = None
        self.lifted_s: float | None = None
        self.at_s: float | None = None
        """When it happens, since uav2 began its mission; None: when the story says so."""
        self._began_s: float | None = None
        self._story = story
        self._lost = False

    def say(self, level: Level, text: str, at_s: float | None = None) -> None:
        self.lines.append(f"{at_s} {level.value} {text}")

    def show_checks(self, found: Sequence[Check]) -> None:
        self.lines += [f"{check.severity.value} {check.subject}: {check.text}" for check in found]

    async def ask(self, question: str) -> bool:
        return bool(question)

    def show(self, context: Context, state: FleetState, now_s: float) -> None:
        story, vehicle = self._story, state.vehicles[VICTIM]
        if not self.shown or self.shown[-1][1] != vehicle.stage.value:
            self.shown.append((now_s, vehicle.stage.value))
        if story.loses and not self._lost and story.loses_at(vehicle, state):
            self._lost = True
            self.running[story.loses].suspend()
        if self.struck_s is None:
            if story.strike is not None and self._due(vehicle, state, now_s):
                self.struck_s = now_s
                for name in story.struck:
                    story.strike(self.running[name])
        elif story.lift is not None and self.lifted_s is None and self._over(vehicle, state, now_s - self.struck_s):
            self.lifted_s = now_s
            for name in story.struck:
                story.lift(self.running[name])

    def _over(self, vehicle: VehicleState, state: FleetState, since_s: float) -> bool:
        lift_at = self._story.lift_at
        return since_s >= self._story.lasts_s if lift_at is None else lift_at(vehicle, state)

    def _due(self, vehicle: VehicleState, state: FleetState, now_s: float) -> bool:
        if self.at_s is None:
            return self._story.at(vehicle, state)
        if self._began_s is None and vehicle.stage is Stage.FLYING:
            self._began_s = now_s
        return self._began_s is not None and now_s - self._began_s >= self.at_s

    def stop_drawing(self) -> None:
        self.lines.append("done")


@dataclass(frozen=True)
class Flown:
    """What a flight left."""

    run: Path
    report: dict[str, Any]
    said: str
    struck_s: float | None
    """When it happened, by the flight's clock."""
    lifted_s: float | None
    shown: tuple[tuple[float, str], ...]
    """What uav2 was taken to do, whenever that changed, by the flight's clock."""
    unseen_modes: tuple[tuple[float, int], ...]
    """Modes of uav2's heartbeats that nobody heard, each with its time by the flight's clock."""
    budget_pct: float
    """Of every vehicle."""

    @property
    def launched_s(self) -> float:
        """When the flight began, by its clock; the times of the report count from here."""
        events = (line for line in log_lines(self.run) if "event" in line)
        return float(next(line["t_s"] for line in events if line["event"]["kind"] == "LaunchOrdered"))

    def says(self, words: str) -> float | None:
        """Return when a line with these words was shown, by the flight's clock; None if none was."""
        return next((line["t_s"] for line in log_lines(self.run) if words in line.get("said", "")), None)

    def vehicle(self, name: str) -> dict[str, Any]:
        """Return what the report says of a vehicle."""
        return next(one for one in self.report["vehicles"] if one["name"] == name)

    def heartbeats(self, name: str) -> list[tuple[float, bool, int]]:
        """Return a vehicle's heartbeats that were heard: the flight's time, whether it was armed, and its mode."""
        began_s = began_unix_s(self.run)
        return [
            (stamp_s - began_s, bool(beat.base_mode & 128), beat.custom_mode)
            for stamp_s, beat in messages(self.run / f"{name}.tlog", "HEARTBEAT")
            if beat.get_srcSystem() != 255 and beat.get_srcComponent() == 1
        ]


def flown(autopilot: Autopilot, story: Story, folder: Path) -> Flown:
    """Fly a story with real vehicles; skips the test where there are none."""
    binary = autopilot.binary
    if not binary:
        pytest.skip(f"{autopilot.variable} does not name a simulator of {autopilot.name}")
    site = site_of(autopilot, story)
    ground = site_model.load_site_model(site, folder)
    console = WatchfulConsole(story)
    if story.prepared is None:
        plan = site_planning.plan_site(ground, site_planning.PlanRequest(Cost.MINMAX, 3.0, 1, all_vehicles=True))
    else:
        prepared = story.prepared(ground)
        ground, plan, console.at_s = prepared.ground, prepared.plan, prepared.at_s
    order = FlightRequest(ground.site, folder, ground, plan, folder / "run", lambda _: ())
    order.run.mkdir()
    write_run_start(order)
    pads = {pad.vehicle: pad for pad in ground.setup.pads}
    wanted = Wanted(
        pads, ground.network.frame, story.speedup, story.settings, frozenset(story.relayed), story.own, story.packs_ah
    )
    with ExitStack() as stack:
        if story.radio:
            ports = range(autopilot.port, autopilot.port + len(NAMES))
            stack.enter_context(RadioRelay(ports, _above_ports(ports), story.radio).running())
        console.running = stack.enter_context(running(autopilot, Path(binary), folder / "sim", wanted))
        stack.enter_context(all_looking(story.eyes))
        if story.radio and autopilot is PX4:
            for number, name in enumerate(NAMES):
                slowed(number, folder / "sim" / name)
        if story.signed:
            (folder / KEY_FILE).write_text(KEY.hex())
            for vehicle in console.running.values():
                vehicle.other.sign(vehicle.sysid, KEY)
        clock.run_on_fair_loop(run_flight.run_flight(order, console))
        relay = console.running[VICTIM].relay
    report = json.loads((order.run / "report.json").read_text())
    began_s = began_unix_s(order.run)
    modes = () if relay is None else ((((at_s - began_s) * story.speedup), mode) for at_s, mode in relay.modes())
    return Flown(
        order.run,
        report,
        "\n".join(console.lines),
        console.struck_s,
        console.lifted_s,
        tuple(console.shown),
        tuple(modes),
        ground.site.vehicle[0].budget_pct,
    )


def site_of(autopilot: Autopilot, story: Story) -> Site:
    """Return the site of a story."""
    signed = {"signing": {"key_file": KEY_FILE}, "link": {"radios": [{"system": 51, "component": 68}]}}
    return check_site(
        {
            **(signed if story.signed else {}),
            **story.tables,
            "network": {"file": "default", "radius_m": story.radius_m},
            "flight": {
                "speedup": story.speedup,
                "connect_timeout_s": 90.0,
                "ready_timeout_s": 240.0,
                "fly_again": "auto",
                **story.flight,
            },
            "faults": dict(story.faults),
            **({"fence": dict(story.fence)} if story.fence else {}),
            "web": {"port": story.page},
            "vehicle": [
                {
                    "name": name,
                    "connection": f"udpin://127.0.0.1:{autopilot.port + number + _above(name, story)}",
                    "sysid": number + 1,
                    "autopilot": autopilot.name,
                    "backend": story.backends.get(name, "native"),
                }
                for number, name in enumerate(NAMES)
            ],
        },
        "test",
    )


def _above(name: str, story: Story) -> int:
    return RELAYED if story.radio or name in story.relayed else 0


def _above_ports(ports: range) -> range:
    return range(ports.start + RELAYED, ports.stop + RELAYED)
