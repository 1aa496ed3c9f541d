"""Starts, returns and parameters, in the order in which each autopilot wants them."""

from __future__ import annotations

import asyncio

import pytest

from executor.core.interface.codes import Ending
from executor.core.interface.commands import SendHome
from executor.core.interface.messages import ParamValue, StatusText
from executor.protocols import vehicle_commands
from executor.runtime import procedures
from executor.runtime.procedures import ProcedureResult
from missions import ARDUPILOT, PX4, Dialect
from tests.fakes.clock import LoopClock
from tests.fakes.link import Air, FakeLink
from tests.fakes.vehicle import FakeAutopilot

pytestmark = [pytest.mark.asyncio, pytest.mark.looptime]

DIALECTS = pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=lambda dialect: str(dialect.name))
ORDER_OF_START = {
    "ardupilot": [vehicle_commands.DO_SET_MODE, vehicle_commands.COMPONENT_ARM_DISARM, vehicle_commands.MISSION_START],
    "px4": [vehicle_commands.COMPONENT_ARM_DISARM, vehicle_commands.DO_SET_MODE],
}


class Pad:
    """A vehicle on its pad."""

    def __init__(self, dialect: Dialect, air: Air | None = None, *, speedup: float = 1.0, **parameters: float) -> None:
        self.clock, self.dialect = LoopClock(speedup), dialect
        self.vehicle = FakeAutopilot(dialect, parameters=parameters)
        self.link = FakeLink(self.vehicle, self.clock, air or Air(), seed=3)

    async def start(self) -> ProcedureResult:
        done = await procedures.arm_and_start(self.link, self.clock, self.dialect)
        self.link.close()
        return done

    async def send_home(self) -> ProcedureResult:
        done = await procedures.give_order(self.link, self.clock, self.dialect, SendHome("uav1"))
        self.link.close()
        return done


@DIALECTS
async def test_a_start(dialect: Dialect) -> None:
    pad = Pad(dialect)
    assert await pad.start() == ProcedureResult(accepted=True)
    assert pad.vehicle.commands == ORDER_OF_START[dialect.name]
    assert (pad.vehicle.armed, pad.vehicle.mode) == (True, dialect.modes.mission)


@DIALECTS
async def test_a_start_over_a_bad_link(dialect: Dialect) -> None:
    pad = Pad(dialect, Air(loss=0.2, duplicate=0.2, delay_s=(0.01, 0.3)))
    assert await pad.start() == ProcedureResult(accepted=True)
    assert (pad.vehicle.armed, pad.vehicle.mode) == (True, dialect.modes.mission)


@DIALECTS
async def test_a_start_while_the_computer_is_busy(dialect: Dialect) -> None:
    """At thirty times real time the five seconds of a command, or of a change of mode, are a sixth of a second."""
    pad = Pad(dialect, speedup=30.0)
    start = asyncio.ensure_future(pad.start())
    pad.link.cut = True
    await asyncio.sleep(1.0)
    pad.link.cut = False
    assert await start == ProcedureResult(accepted=True)


class SleepyClock:
    """The clock of a computer that was closed for a while."""

    speedup = 1.0

    def __init__(self) -> None:
        self.slept_s = 0.0

    def now_s(self) -> float:
        return LoopClock().now_s() + self.slept_s


@DIALECTS
@pytest.mark.parametrize("answers", [[0], [4]], ids=["between two steps", "while it waits to arm again"])
async def test_a_computer_that_slept_starts_no_vehicle_by_an_expired_clearance(
    dialect: Dialect, answers: list[int]
) -> None:
    pad, clock = Pad(dialect), SleepyClock()
    pad.vehicle.results[vehicle_commands.COMPONENT_ARM_DISARM] = answers
    start = asyncio.ensure_future(procedures.arm_and_start(pad.link, clock, dialect))
    for _ in range(300):
        if vehicle_commands.COMPONENT_ARM_DISARM in pad.vehicle.commands:
            break
        await asyncio.sleep(0.01)
    clock.slept_s = 30.0
    done = await start
    pad.link.close()
    assert (done.accepted, done.reason, done.code) == (False, procedures.SLEPT, Ending.STOOD_STILL)
    assert pad.vehicle.commands.count(vehicle_commands.COMPONENT_ARM_DISARM) == 1
    assert vehicle_commands.MISSION_START not in pad.vehicle.commands
    assert pad.vehicle.mode != dialect.modes.mission


@DIALECTS
async def test_arming_is_tried_with_patience(dialect: Dialect) -> None:
    pad = Pad(dialect)
    pad.vehicle.results[vehicle_commands.COMPONENT_ARM_DISARM] = [4, 4, 0]
    assert await pad.start() == ProcedureResult(accepted=True)
    assert pad.vehicle.commands.count(vehicle_commands.COMPONENT_ARM_DISARM) == 3


@DIALECTS
async def test_a_vehicle_that_cannot_be_armed_says_why(dialect: Dialect) -> None:
    pad = Pad(dialect)
    pad.vehicle.results[vehicle_commands.COMPONENT_ARM_DISARM] = [4]
    pad.link.say(StatusText(4, "Arm: compass not calibrated"))
    pad.link.say(StatusText(6, "a mere remark"))
    done = await pad.start()
    assert done == ProcedureResult(accepted=False, reason="arm: failed; it says: Arm: compass not calibrated")
    assert not pad.vehicle.armed


@DIALECTS
async def test_a_foreign_mode_change_while_arming_cancels_the_start(dialect: Dialect) -> None:
    pad = Pad(dialect)
    pad.vehicle.results[vehicle_commands.COMPONENT_ARM_DISARM] = [4]
    start = asyncio.ensure_future(pad.start())
    await asyncio.sleep(5.0)
    pad.vehicle.mode = dialect.modes.return_home
    done = await start
    assert done == ProcedureResult(accepted=False, reason="another party changed its mode")
    assert done.code is Ending.MODE_CHANGED
    armings = pad.vehicle.commands.count(vehicle_commands.COMPONENT_ARM_DISARM)
    await asyncio.sleep(30.0)
    assert pad.vehicle.commands.count(vehicle_commands.COMPONENT_ARM_DISARM) == armings <= 5


@DIALECTS
async def test_an_acknowledgement_is_no_arming(dialect: Dialect) -> None:
    pad = Pad(dialect)
    pad.vehicle.deaf.add(vehicle_commands.COMPONENT_ARM_DISARM)
    assert await pad.start() == ProcedureResult(accepted=False, reason="does not report that it is armed", armed=True)


async def test_ardupilot_that_denies_the_mission_has_not_started() -> None:
    pad = Pad(ARDUPILOT)
    pad.vehicle.results[vehicle_commands.MISSION_START] = [4]
    assert await pad.start() == ProcedureResult(accepted=False, reason="start the mission: failed", armed=True)


async def test_ardupilot_that_disarmed_before_the_order_came_has_not_started() -> None:
    """It stands on its pad in mission mode, and takes off no more: the start is tried again from its beginning."""
    pad = Pad(ARDUPILOT)
    pad.vehicle.tires = True
    assert await pad.start() == ProcedureResult(accepted=False, reason="is not armed in mission mode", armed=True)


async def test_px4_that_stays_in_its_mode_has_not_started() -> None:
    pad = Pad(PX4)
    pad.vehicle.deaf.add(vehicle_commands.DO_SET_MODE)
    assert await pad.start() == ProcedureResult(accepted=False, reason="does not report the new mode", armed=True)


@DIALECTS
async def test_a_return_is_seen_in_the_heartbeat(dialect: Dialect) -> None:
    pad = Pad(dialect)
    assert await pad.send_home() == ProcedureResult(accepted=True)
    assert pad.vehicle.mode == dialect.modes.return_home
    deaf = Pad(dialect)
    deaf.vehicle.deaf.add(vehicle_commands.DO_SET_MODE)
    assert await deaf.send_home() == ProcedureResult(accepted=False, reason="does not report the new mode")


@DIALECTS
async def test_a_vehicle_whose_heartbeats_got_lost_is_asked_for_one_before_it_is_judged(dialect: Dialect) -> None:
    """A stock radio destroyed five in a row, and a PX4 in the air was called not to have started."""
    pad = Pad(dialect)
    pad.vehicle.unheard = True
    assert await pad.start() == ProcedureResult(accepted=True)
    assert vehicle_commands.REQUEST_MESSAGE in pad.vehicle.commands
    deaf = Pad(dialect)
    deaf.vehicle.unheard, deaf.vehicle.deaf = True, {vehicle_commands.DO_SET_MODE}
    assert await deaf.send_home() == ProcedureResult(accepted=False, reason="does not report the new mode")


@DIALECTS
async def test_an_rtl_without_an_answer(dialect: Dialect) -> None:
    pad = Pad(dialect)
    pad.link.cut = True
    assert await pad.send_home() == ProcedureResult(
        accepted=False, reason="change of mode: no acknowledgement", lost=True
    )


@DIALECTS
async def test_a_landing_vehicle_needs_no_return(dialect: Dialect) -> None:
    pad = Pad(dialect)
    pad.vehicle.mode = dialect.modes.land
    pad.vehicle.deaf.add(vehicle_commands.DO_SET_MODE)
    assert await pad.send_home() == ProcedureResult(accepted=True)


async def test_parameters_are_read_and_set() -> None:
    pad = Pad(ARDUPILOT, RTL_ALT=1500.0)
    read = await procedures.read_parameter(pad.link, pad.clock, "RTL_ALT")
    assert read.value == ParamValue("RTL_ALT", 1500.0, 9)
    assert await procedures.set_parameter(pad.link, pad.clock, "RTL_ALT", 2500.0, 4) == ProcedureResult(accepted=True)
    assert pad.vehicle.parameters["RTL_ALT"] == 2500.0
    unknown = await procedures.set_parameter(pad.link, pad.clock, "NO_SUCH", 1.0, 4)
    assert unknown == ProcedureResult(accepted=False, reason="NO_SUCH: no answer", lost=True)
    pad.link.close()


async def test_a_parameter_is_asked_for_as_long_as_a_busy_computer_may_need() -> None:
    """At ten times real time the four questions of one dialogue are asked within 0.4 s."""
    pad = Pad(PX4, RTL_RETURN_ALT=60.0)
    pad.clock = LoopClock(speedup=10.0)
    pad.link = FakeLink(pad.vehicle, pad.clock)
    pad.link.cut = True
    asyncio.get_running_loop().call_later(1.5, setattr, pad.link, "cut", False)
    read = await procedures.read_parameter(pad.link, pad.clock, "RTL_RETURN_ALT")
    assert read.value == ParamValue("RTL_RETURN_ALT", 60.0, 9)
    pad.link.cut = True
    nothing = await procedures.read_parameter(pad.link, pad.clock, "RTL_RETURN_ALT")
    assert nothing.value is None
    pad.link.close()
