"""Which vehicles answer and are ready, and their missions before take-off."""

from __future__ import annotations

import asyncio
import math

import pytest

from executor.core.interface.messages import (
    DoubleHeard,
    Heartbeat,
    Message,
    MissionItemInt,
    MissionRequestList,
    Outgoing,
    Position,
    SendCommand,
    StationActed,
    StationHeard,
    StatusText,
    SystemStatus,
    Version,
)
from executor.core.preflight import onboard_failsafes
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.core.radio_budget import list_streams_hz
from executor.core.telemetry.vehicle_identity import MAX_SYSTEMS
from executor.errors import ConnectionFailed, PreflightFailed, VehicleRefused
from executor.protocols import vehicle_commands
from executor.runtime import vehicle_preflight
from missions import ARDUPILOT, PX4, Dialect, Inspection, build_flight_path, encode, plan_flight_setup
from tests.fakes.clock import LoopClock
from tests.fakes.flyer import Flyer
from tests.fakes.link import Air, FakeLink
from tests.missions.builders import FRAME, line_east

pytestmark = [pytest.mark.asyncio, pytest.mark.looptime]

DIALECTS = pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=lambda dialect: str(dialect.name))
FAILING = SystemStatus(90.0, 16.0, 0x10000000, prearm_ok=False)


class Ready:
    """A vehicle that can be asked; what it says besides its telemetry is up to the test."""

    def __init__(self, dialect: Dialect, **parameters: float) -> None:
        self.clock, self.dialect = LoopClock(), dialect
        self.vehicle = Flyer(dialect, FRAME, (3.0, 4.0), FRAME.alt_m)
        self.vehicle.parameters = dict(parameters)
        self.link = FakeLink(self.vehicle, self.clock)
        self.waited_for: list[str] = []

    def says(self, message: Message, after_s: float) -> None:
        asyncio.get_running_loop().call_later(after_s, self.link.say, message)

    async def interview(self, timeout_s: float = 30.0) -> VehicleFacts:
        try:
            return await vehicle_preflight.interview_vehicle(
                "uav1", self.link, self.clock, self.dialect, timeout_s, self.waited_for.append
            )
        finally:
            self.link.close()


@DIALECTS
async def test_a_vehicle_that_is_ready(dialect: Dialect) -> None:
    rule = dialect.ground_station_failsafe
    ready = Ready(dialect, **{rule.action: 1.0, rule.timeout: 5.0})
    ready.says(Version(4, 7, 2), 0.5)
    facts = await ready.interview()
    assert (facts.name, facts.remaining_pct, facts.version) == ("uav1", 100.0, Version(4, 7, 2))
    assert facts.parameters == {rule.action: 1.0, rule.timeout: 5.0}
    assert facts.unread == frozenset(), "the others are not there: these two were answered over the same link"
    assert facts.words == f"quadrotor, {'ArduPilot' if dialect is ARDUPILOT else 'PX4'} 4.7.2"
    assert FRAME.to_local_m(facts.position.lat_deg, facts.position.lon_deg) == pytest.approx((3.0, 4.0), abs=0.01)
    assert ready.vehicle.commands.count(511) == len(list_streams_hz(dialect))


async def test_what_a_vehicle_does_not_say_is_not_made_up() -> None:
    facts = await Ready(PX4).interview()
    assert (facts.version, facts.parameters, facts.stations) == (None, {}, ())
    assert facts.unread == {*onboard_failsafes.list_preflight_parameters(PX4)}, (
        "nobody knows whether it is the link or the vehicle"
    )
    assert facts.words == "quadrotor, PX4 of unknown version"


async def test_a_firmware_without_a_version_message_is_asked_for_its_banner() -> None:
    ready = Ready(ARDUPILOT)
    asked = ready.vehicle.hear

    def hear(message: Outgoing, now_s: float) -> list[Message]:
        said = asked(message, now_s)
        if isinstance(message, SendCommand) and message.command == vehicle_commands.DO_SEND_BANNER:
            said.append(StatusText(6, "ArduCopter V4.5.7 (2a3dc4b7)"))
        return said

    ready.vehicle.hear = hear  # type: ignore[method-assign]
    assert (await ready.interview()).version == Version(4, 5, 7)


async def test_another_ground_station_on_the_link_is_noticed() -> None:
    ready = Ready(PX4)
    for after_s in (0.5, 1.5):
        ready.says(StationHeard(254, 190), after_s)
        ready.says(StationActed(254, 190, "sets RTL_ALT to 3000"), after_s)
    facts = await ready.interview()
    assert facts.stations == (StationHeard(254, 190),)
    assert facts.acts == (StationActed(254, 190, "sets RTL_ALT to 3000"),)


async def test_another_vehicle_of_its_number_behind_its_address_is_noticed() -> None:
    ready = Ready(ARDUPILOT)
    for tenth in range(0, 80, 2):
        elsewhere = Position(tenth / 10 + 500.0, 48.0, 12.0, 300.0, 0.0, 0.0, 0.0, 0.0, None)
        ready.says(elsewhere, tenth / 10)
    assert (await ready.interview()).doubles == (DoubleHeard(0, ()),)


async def test_two_hundred_strangers_before_the_flight_are_a_few_lines() -> None:
    ready = Ready(PX4)
    for system in range(2, 202):
        ready.says(StationHeard(system, 190), 0.5)
    assert len((await ready.interview()).stations) == MAX_SYSTEMS


async def test_a_thousand_reasons_are_reported_once_a_second() -> None:
    ready = Ready(ARDUPILOT)
    for tenth in range(1000):
        ready.says(FAILING, tenth / 100)
        ready.says(StatusText(4, f"PreArm: reason {tenth}"), tenth / 100)
    with pytest.raises(PreflightFailed, match=r"17 more$"):
        await ready.interview(timeout_s=10.0)
    assert 5 <= len(ready.waited_for) <= 12


@pytest.mark.parametrize(("name", "most_s"), [("MOT_BAT_VOLT_MAX", 3.0), ("WPNAV_JERK", 5.0)])
async def test_what_a_firmware_does_not_have_costs_a_moment(name: str, most_s: float) -> None:
    """It takes several questions to know that it is not the link; then some are asked for by another name."""
    known = dict.fromkeys(onboard_failsafes.list_preflight_parameters(ARDUPILOT), 1.0)
    del known[name], known["FENCE_AUTOENABLE"]
    ready = Ready(ARDUPILOT, **known)
    ready.says(Version(4, 7, 2), 0.5)
    facts = await ready.interview()
    assert (facts.parameters, facts.unread) == (known, frozenset())
    assert ready.clock.now_s() < vehicle_preflight.STEADY_S + most_s


async def test_the_older_name_of_a_parameter_is_asked_for_where_the_newer_is_not_there() -> None:
    facts = await Ready(ARDUPILOT, SYSID_MYGCS=252.0, FS_GCS_ENABLE=1.0).interview()
    assert facts.parameters == {"SYSID_MYGCS": 252.0, "FS_GCS_ENABLE": 1.0}


async def test_the_names_of_copter_4_7_are_asked_for_where_the_older_are_not_there() -> None:
    facts = await Ready(ARDUPILOT, WP_SPD=12.0, LAND_SPD_MS=0.4, FS_GCS_ENABLE=1.0).interview()
    assert facts.parameters == {"WP_SPD": 12.0, "LAND_SPD_MS": 0.4, "FS_GCS_ENABLE": 1.0}


async def test_a_parameter_that_is_no_number_is_not_known() -> None:
    ready = Ready(ARDUPILOT, FS_GCS_ENABLE=math.nan)
    assert (await ready.interview()).parameters == {}


async def test_a_vehicle_with_failing_checks_is_waited_for() -> None:
    ready = Ready(ARDUPILOT)
    ready.says(FAILING, 0.1)
    ready.says(SystemStatus(90.0, 16.0, 0, prearm_ok=True), 12.0)
    await ready.interview()
    assert ready.clock.now_s() >= 12.0 + vehicle_preflight.STEADY_S


async def test_a_moment_of_readiness_is_not_enough() -> None:
    ready = Ready(ARDUPILOT)
    good = SystemStatus(90.0, 16.0, 0, prearm_ok=True)
    for at_s, status in ((0.1, FAILING), (6.0, good), (7.0, FAILING), (15.0, good)):
        ready.says(status, at_s)
    await ready.interview()
    assert ready.clock.now_s() >= 15.0 + vehicle_preflight.STEADY_S


async def test_a_vehicle_that_never_gets_ready_says_why() -> None:
    ready = Ready(ARDUPILOT)
    ready.says(StatusText(4, "PreArm: compass not calibrated"), 0.05)
    ready.says(FAILING, 0.1)
    with pytest.raises(PreflightFailed) as raised:
        await ready.interview(20.0)
    why = "its own pre-arm checks fail: compass not calibrated"
    assert str(raised.value) == f"uav1: not ready after 20 s: {why}"
    assert ready.waited_for[-1] == why
    assert ready.vehicle.commands.count(vehicle_commands.RUN_PREARM_CHECKS) == 2


async def test_a_place_in_the_gulf_of_guinea_is_no_place() -> None:
    """Both autopilots report 0, 0 before they have a fix."""
    ready = Ready(PX4)
    ready.vehicle._position = lambda: Position(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, None)  # type: ignore[method-assign]
    with pytest.raises(PreflightFailed, match=r"uav1: not ready after 20 s: no position"):
        await ready.interview(20.0)


async def test_no_vehicle_answers() -> None:
    ready = Ready(PX4)
    ready.link.cut = True
    with pytest.raises(ConnectionFailed, match=r"uav1: no heartbeat of system 7 on udpin://:14550 within 15 s"):
        await vehicle_preflight.wait_for_vehicle("uav1", "udpin://:14550", 7, ready.link, 15.0, ready.clock)
    ready.link.close()


async def test_a_heartbeat_is_an_answer() -> None:
    ready = Ready(PX4)
    await vehicle_preflight.wait_for_vehicle("uav1", "udpin://:14550", 7, ready.link, 15.0, ready.clock)
    assert ready.clock.now_s() < 2.0
    ready.link.close()


@DIALECTS
async def test_a_mission_that_does_not_come_on_board_stops_the_flight(dialect: Dialect) -> None:
    ready = Ready(dialect)
    setup = plan_flight_setup(line_east(3), ["uav1"], Inspection())
    mission = encode(build_flight_path(setup, "uav1", (0, 2)), dialect)
    await vehicle_preflight.load_mission("uav1", ready.link, ready.clock, dialect, mission)
    ready.vehicle.missions.spoils = 3
    with pytest.raises(PreflightFailed, match="uav1: the mission is not on board: read-back differs: item 3"):
        await vehicle_preflight.load_mission("uav1", ready.link, ready.clock, dialect, mission)
    ready.link.close()


@DIALECTS
async def test_an_interrupted_upload_is_tried_again_before_a_vehicle_is_refused(dialect: Dialect) -> None:
    """A radio that drops out in the midst of an upload, for longer than one upload is repeated in flight."""
    ready, told = Ready(dialect), list[str]()
    setup = plan_flight_setup(line_east(3), ["uav1"], Inspection())
    mission = encode(build_flight_path(setup, "uav1", (0, 2)), dialect)
    ready.vehicle.missions.stops_at = 4

    def tell(line: str) -> None:
        told.append(line)
        ready.vehicle.missions.stops_at = None

    await vehicle_preflight.load_mission("uav1", ready.link, ready.clock, dialect, mission, tell)
    ready.link.close()
    assert len(told) == 1
    assert told[0].startswith("uav1: the upload was broken off (")


@DIALECTS
@pytest.mark.parametrize("when", ["in its midst", "before its read-back"])
async def test_a_radio_that_is_gone_from_the_midst_of_an_upload_on_is_waited_for(dialect: Dialect, when: str) -> None:
    """Nobody answers the tries that follow: that ends nothing, and is no vehicle's refusal."""
    ready, told = Ready(dialect), list[str]()
    ready.link.air = Air(delay_s=(0.05, 0.05))
    setup = plan_flight_setup(line_east(3), ["uav1"], Inspection())
    mission = encode(build_flight_path(setup, "uav1", (0, 2)), dialect)

    def cut() -> None:
        items = sum(isinstance(message, MissionItemInt) for _, message in ready.link.sent)
        asked = any(isinstance(message, MissionRequestList) for _, message in ready.link.sent)
        ready.link.cut = asked if when == "before its read-back" else items >= 4
        if not ready.link.cut:
            asyncio.get_running_loop().call_later(0.01, cut)

    def tell(line: str) -> None:
        told.append(line)
        ready.link.cut = False

    cut()
    await vehicle_preflight.load_mission("uav1", ready.link, ready.clock, dialect, mission, tell)
    ready.link.close()
    assert [line.startswith("uav1: the upload was broken off (") for line in told] == [True]


@DIALECTS
async def test_an_upload_that_is_always_broken_off_is_a_refusal(dialect: Dialect) -> None:
    ready = Ready(dialect)
    setup = plan_flight_setup(line_east(3), ["uav1"], Inspection())
    mission = encode(build_flight_path(setup, "uav1", (0, 2)), dialect)
    ready.vehicle.missions.stops_at = 4
    with pytest.raises(VehicleRefused, match="uav1: the mission is not on board: "):
        await vehicle_preflight.load_mission("uav1", ready.link, ready.clock, dialect, mission)
    ready.link.close()


@pytest.mark.parametrize(("armed", "found"), [(False, True), (True, False)])
async def test_alternating_positions_are_two_vehicles_on_the_ground_and_one_in_the_air(
    *, armed: bool, found: bool
) -> None:
    """A flight that is resumed asks its vehicles in the air."""
    heard = vehicle_preflight._VehicleAnswers(LoopClock())
    heard.update(Heartbeat(3, 3, armed=armed, system_status=4))
    for number in range(60):
        north_deg = 6.0 / 111_320.0 * (number % 2)
        heard.update(Position(0.2 * number, 50.0 + north_deg, 13.0, 300.0, 0.0, 0.0, 0.0, 0.0, None))
        await asyncio.sleep(0.2)
    assert any(isinstance(one, DoubleHeard) for one in heard.strangers) is found
