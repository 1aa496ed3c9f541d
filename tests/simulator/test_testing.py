"""A fleet for tests: in a thread or in the test's loop, stepped, in virtual or real time; truths, faults, ports."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mav

from simulator.config import AutopilotKind
from simulator.errors import FaultSpecError, FleetError, SimulatorError
from simulator.testing import ANY_PORT, Fleet, fleet
from tests.patience import PATIENCE_S
from tests.simulator.harness import sim_vehicle

HEARTBEAT = mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(mav.MAVLink(None, srcSystem=255, srcComponent=190))
ARM = HEARTBEAT + mav.MAVLink_command_long_message(0, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0).pack(
    mav.MAVLink(None, srcSystem=255)
)


@pytest.fixture
def plug() -> Iterator[socket.socket]:
    """A client's socket, at a port that the system has chosen."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        one.settimeout(PATIENCE_S)
        yield one


def system_heard(plug: socket.socket) -> int:
    [message, *_] = mav.MAVLink(None).parse_buffer(plug.recv(4096))
    return int(message.get_srcSystem())


def test_each_vehicle_has_a_port_of_its_own_and_is_called_in_two_ways(plug: socket.socket) -> None:
    with fleet(3) as living, fleet(3) as other:
        ports = {one.port for both in (living, other) for one in both}
        assert len(ports) == 6
        assert living["uav2"] is living[1]
        assert living.connections[1] == f"udpout://127.0.0.1:{living[1].port}"
        assert living[1].pymavlink == f"udpout:127.0.0.1:{living[1].port}"
        for one in living:
            plug.sendto(HEARTBEAT, ("127.0.0.1", one.port))
            while system_heard(plug) != one.sysid:
                pass


def test_a_vehicle_calls_a_client_that_listens(plug: socket.socket) -> None:
    with fleet(2) as living:
        living[1].call(plug.getsockname()[1])
        assert system_heard(plug) == 2


def test_a_stepped_fleet_lives_only_while_it_is_stepped(plug: socket.socket) -> None:
    beats: list[float] = []
    with fleet(stepped=True) as living:
        assert living.now_s == 0.0
        living.advance(2.5, beat=lambda: beats.append(living.now_s))
        assert living.now_s == pytest.approx(2.5)
        plug.sendto(ARM, ("127.0.0.1", living[0].port))
        living.wait_until(lambda: living[0].truth.armed, 1.0)
        assert living[0].events[:2] == ["order command 400 1", "armed"]
        assert living.truths[0].unix_s == pytest.approx(living.truths[0].t_s + living.truths[0].unix_s, rel=1)
        began_s = living.now_s
        with pytest.raises(TimeoutError, match="not so within 3 simulated seconds; last happened: uav1 order"):
            living.wait_until(lambda: False, 3.0)
        assert living.now_s == pytest.approx(began_s + 3.0)
    assert beats == pytest.approx([0.0, 1.0, 2.0])
    assert living[0].truth.armed, "what was true at the end can be read behind it"


def test_a_fleet_in_running_time_is_waited_for_and_not_advanced(plug: socket.socket) -> None:
    with fleet(speedup=10.0) as living:
        with pytest.raises(FleetError, match="only one with stepped=True is advanced"):
            living.advance(1.0)
        plug.sendto(ARM, ("127.0.0.1", living[0].port))
        living.wait_until(lambda: living[0].truth.armed, 6000.0)
        with pytest.raises(ZeroDivisionError):
            living.wait_until(lambda: bool(1 / 0))
        with pytest.raises(TimeoutError):
            living.wait_until(lambda: False, 1.0)
        assert living[0].truth.armed


@pytest.mark.virtual_time(limit_s=7200)
async def test_in_virtual_time_a_client_in_memory_and_one_with_a_socket() -> None:
    heard: list[bytes] = []
    loop = asyncio.get_running_loop()
    async with fleet(2) as living:
        send = living[0].open_link(heard.append)
        transport, _ = await loop.create_datagram_endpoint(
            asyncio.DatagramProtocol, remote_addr=("127.0.0.1", living[1].port)
        )
        send(ARM)
        transport.sendto(ARM)
        await living.wait_for(lambda: all(one.truth.armed for one in living), 5.0)
        await asyncio.sleep(3600.0)
        assert living.now_s == pytest.approx(loop.time(), abs=0.1)
        with pytest.raises(TimeoutError):
            await living.wait_for(lambda: False, 10.0)
        transport.close()
    assert len(heard) > 3600
    assert not living[0].truth.armed, "PX4 disarms where nobody takes off"


def test_a_fleet_in_a_thread_has_no_links_in_memory() -> None:
    with fleet() as living, pytest.raises(FleetError, match="async with fleet"):
        living[0].open_link(print)


@pytest.mark.asyncio
async def test_a_stepped_fleet_is_no_fleet_of_a_loop() -> None:
    with pytest.raises(FleetError, match="with fleet"):
        async with fleet(stepped=True):
            pass


def test_faults_by_the_grammar_now_and_in_their_time() -> None:
    with fleet(2, stepped=True, faults=["uav2:battery-step=30@0s"]) as living:
        living.advance(0.1)
        living.inject("all:battery-step=10")
        living[0].inject("battery-step=5@0s")
        living[1].inject("crash@50%")
        living.advance(0.1)
        charges = [one.truth.charge_pct for one in living]
        assert charges == pytest.approx([85.0, 60.0], abs=0.1)
        assert living[0].events == ["fault all:battery-step=10@0s", "fault uav1:battery-step=5@0s"]
        with pytest.raises(FaultSpecError, match="no vehicle 'uav3', expected one of all, uav1, uav2"):
            living.inject("uav3:crash")
        with pytest.raises(FaultSpecError, match="unknown kind"):
            living[0].inject("vanish")


def test_vehicles_of_both_kinds_stand_in_a_row_ready_to_be_armed() -> None:
    with fleet(3, autopilot=["px4", "ardupilot"], parameters={}, stepped=True) as living:
        kinds = [one.simulated.autopilot.vehicle.autopilot for one in living]
        assert kinds == [AutopilotKind.PX4, AutopilotKind.ARDUPILOT, AutopilotKind.PX4]
        assert [one.truth.mode for one in living] == ["LOITER", "STABILIZE", "LOITER"]
        assert all(one.simulated.autopilot.is_ready for one in living)
        assert living[1].truth.lon_deg > living[0].truth.lon_deg
        assert living[0].truth.parameters["COM_DL_LOSS_T"] == 10


def test_what_a_fleet_does_not_have_is_refused_before_it_lives() -> None:
    with pytest.raises(SimulatorError, match="unknown profile 'sik65'"):
        fleet(radio="sik65")
    with pytest.raises(FleetError, match="no parameter 'NONE'"):
        fleet(parameters={"NONE": 1.0})
    with pytest.raises(FleetError, match="1 vehicles of 'copter': expected 1 or more, of ardupilot and px4"):
        fleet(autopilot="copter")
    with pytest.raises(FleetError, match="0 vehicles"):
        fleet(0)
    assert fleet(radio="sik64")[0].simulated.radio is not None


def test_what_fails_in_the_fleet_is_raised_in_the_test() -> None:
    def fail(_: object) -> None:
        raise ValueError("so it is")

    vehicle = sim_vehicle(AutopilotKind.PX4, connection=ANY_PORT)
    with pytest.raises(ValueError, match="so it is"), Fleet(fleet([vehicle]).config, watch=fail):
        pass


def test_the_client_is_checked_and_its_dialogue_shown(plug: socket.socket) -> None:
    with fleet(stepped=True) as living:
        plug.sendto(HEARTBEAT, ("127.0.0.1", living[0].port))
        living.advance(1.0)
        living.check_client()
        item = mav.MAVLink_mission_item_int_message(1, 1, 0, 6, 16, 0, 1, 0, 0, 0, 0, 1, 1, 10)
        plug.sendto(item.pack(mav.MAVLink(None, srcSystem=255)), ("127.0.0.1", living[0].port))
        living.advance(0.1)
        living.check_client(but={"upload"})
        with pytest.raises(AssertionError) as caught:
            living.check_client()
    said = str(caught.value).splitlines()
    assert said[0] == "the client did wrong:"
    assert said[1].endswith("uav1: client 255 sends item 0 while no upload is under way")
    assert said[-2].endswith("255 -> uav1     MISSION_ITEM_INT 0 NAV_WAYPOINT")
