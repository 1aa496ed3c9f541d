"""A person takes a vehicle: nothing is commanded, its work is kept, then given away; it comes back by consent."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mav

from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.endpoints import Router, VehicleLink
from executor.core.interface.commands import Command, Hold, LandNow, Level, Resume, SendHome, Start, Upload
from executor.core.interface.events import Heard, ReturnAllOrdered, ReturnEnded
from executor.core.interface.intents import Action, Outcome
from executor.core.interface.messages import FlightMessage, Message, OrderSeen, RcChannels, StatusText
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import fleet_of, with_facts
from tests.executor.core.stories import EVERYTHING, under_way
from tests.fakes.flight import Story

LOITER = {"ardupilot": 5, "px4": 3 << 16}
GRACE_S = 30.0
UAV2 = 2
"""Its system."""


def mission(flight: Story) -> int:
    return flight.context.vehicles["uav2"].dialect.modes.mission.custom_mode


def told(flight: Story, name: str, after_s: float) -> list[Command]:
    """Everything that a vehicle was told since."""
    kinds = (SendHome, Start, Hold, Resume, LandNow, Upload)
    return [
        command
        for at_s, command in flight.commands
        if at_s >= after_s and isinstance(command, kinds) and command.vehicle == name
    ]


def taken(autopilot: str = "ardupilot", mode: int | None = None) -> tuple[Story, float]:
    """Return a flight in which uav2's pilot has switched its mode, and when."""
    flight = under_way(fleet_of(autopilot=autopilot))
    flight.crafts["uav2"].mode = LOITER[autopilot] if mode is None else mode
    at_s = flight.now_s
    flight.run(lambda: flight.stage("uav2") is Stage.PILOT)
    return flight, at_s


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_vehicle_that_its_pilot_has_is_never_commanded(autopilot: str) -> None:
    flight, at_s = taken(autopilot)
    assert flight.said(Level.FAULT)[0].startswith("uav2: with its pilot, mode ")
    flight.pass_s(300.0)
    assert told(flight, "uav2", at_s) == []
    assert flight.stage("uav2") is Stage.PILOT
    assert flight.vehicle("uav2").fault is None
    assert set(flight.state.coverage.inspected) == EVERYTHING, "the others have its segments"


@pytest.mark.parametrize(
    ("evidence", "words"),
    [
        ((RcChannels((1500, 1500, 1600, 1500, 1430)), RcChannels((1500, 1500, 1600, 1500, 1326))),
         "uav2: its pilot has switched it to LOITER; not commanded from here"),
        ((OrderSeen(176, 5, 254),), "uav2: another ground station has ordered it to LOITER; not commanded from here"),
    ],
)  # fmt: skip
def test_the_party_in_control_is_named_if_known(evidence: tuple[RcChannels | OrderSeen, ...], words: str) -> None:
    flight = under_way()
    for message in evidence:
        flight.happen(Heard("uav2", message))
    flight.crafts["uav2"].mode = LOITER["ardupilot"]
    at_s = flight.now_s
    flight.run(lambda: flight.stage("uav2") is Stage.PILOT)
    assert flight.said(Level.FAULT)[0].startswith(words)
    flight.pass_s(300.0)
    assert told(flight, "uav2", at_s) == []


def frames(number: int, *messages: Any) -> list[bytes]:
    """Return what the system of uav2, or another one, says."""
    sender = mav.MAVLink(None, srcSystem=number, srcComponent=1 if number == UAV2 else 190)
    return [bytes(message.pack(sender)) for message in messages]


ACCEPTED_RTL = frames(UAV2, mav.MAVLink_command_ack_message(20, 0, 0, 0, 254, 190))
ACCEPTED_MODE = frames(UAV2, mav.MAVLink_command_ack_message(176, 0, 0, 0, 254, 190))
TWINS_ANSWER = frames(UAV2, mav.MAVLink_command_ack_message(176, 0, 0, 0, 255, 190))
ORDERED_RTL = frames(254, mav.MAVLink_command_long_message(UAV2, 1, 20, 0, *[0.0] * 7))


def told_by(flight: Story, datagrams: list[bytes]) -> None:
    """Take datagrams on uav2's link."""
    codec = MavlinkCodec()
    link = VehicleLink(UAV2, codec)

    def heard(message: Message) -> None:
        if isinstance(message, FlightMessage):
            flight.happen(Heard("uav2", message))

    link.listen(heard)
    for datagram in datagrams:
        Router([link], codec).route_frames(codec.decode(datagram), lambda _: True)


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
@pytest.mark.parametrize(
    ("datagrams", "others"),
    [
        (ACCEPTED_RTL, True),
        (ORDERED_RTL, True),  # its answer gets lost
        ([*ORDERED_RTL, *ORDERED_RTL, *ACCEPTED_RTL, *ACCEPTED_RTL], True),
        (ACCEPTED_MODE, True),
        (TWINS_ANSWER, True),  # nothing was ordered from here for minutes
        (frames(UAV2, mav.MAVLink_command_ack_message(20, 2, 0, 0, 254, 190)), False),  # it refuses
        (frames(9, mav.MAVLink_command_ack_message(20, 0, 0, 0, 254, 190)), False),  # another vehicle does
        ([], False),
    ],
)
def test_a_return_that_another_station_ordered_is_not_a_failsafes(
    autopilot: str, datagrams: list[bytes], others: bool
) -> None:
    flight = under_way(fleet_of(autopilot=autopilot))
    flight.pass_s(max(0.0, flight.vehicle("uav2").orders.ordered_mode_s + 121.0 - flight.now_s))
    home = flight.context.vehicles["uav2"].dialect.modes.return_home.custom_mode
    told_by(flight, datagrams)
    flight.crafts["uav2"].mode, at_s = home, flight.now_s
    flight.run(lambda: flight.stage("uav2") is Stage.PILOT)
    words = "another ground station has ordered it to" if others else "with its pilot, mode"
    assert flight.said(Level.FAULT)[0].startswith(f"uav2: {words} ")
    flight.pass_s(100.0)
    assert told(flight, "uav2", at_s) == []


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_the_answer_to_an_order_of_ours_is_no_other_stations(autopilot: str) -> None:
    """A return that was commanded here, answered twice and late, is nobody else's; nor is a failsafe after it."""
    flight = under_way(fleet_of(autopilot=autopilot))
    flight.happen(ReturnAllOrdered())
    flight.pass_s(2.0)
    told_by(flight, [*TWINS_ANSWER, *TWINS_ANSWER])
    flight.pass_s(20.0)
    told_by(flight, TWINS_ANSWER)
    assert flight.stage("uav2") is Stage.RETURNING
    assert flight.vehicle("uav2").evidence.others_orders == ()


def test_its_segments_are_kept_for_a_while() -> None:
    flight, at_s = taken()
    flight.run(lambda: bool(flight.solves()))
    assert GRACE_S - 1.0 <= flight.now_s - at_s <= GRACE_S + 3.0
    assert "uav2: with its pilot for 30 s" in flight.solves()[0].trigger


def test_switching_back_and_forth_is_answered_by_nothing() -> None:
    flight, at_s = taken()
    for _ in range(4):
        flight.crafts["uav2"].mode = mission(flight)
        flight.pass_s(5.0)
        flight.crafts["uav2"].mode = LOITER["ardupilot"]
        flight.pass_s(5.0)
    assert told(flight, "uav2", at_s) == []


def test_a_vehicle_back_on_its_mission_and_included_finishes_it() -> None:
    flight, at_s = taken()
    assert flight.ask(Action.INCLUDE, "uav2").text == "it is with its pilot: the pilot must set mission mode first"
    flight.crafts["uav2"].mode = mission(flight)
    flight.run(lambda: "use include to put it back in the plan" in flight.said(Level.FAULT)[-1])
    assert told(flight, "uav2", at_s) == []
    flight.pass_s(GRACE_S)
    assert not any("pilot" in solve.trigger for solve in flight.solves()), "it flies its segments"
    assert flight.ask(Action.INCLUDE, "uav2").outcome is Outcome.DONE
    assert flight.stage("uav2") is Stage.FLYING
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_site_may_take_it_back_without_asking() -> None:
    flight = under_way(fleet_of(flight={"pilot_return": "auto"}))
    flight.crafts["uav2"].mode = LOITER["ardupilot"]
    flight.run(lambda: flight.stage("uav2") is Stage.PILOT)
    flight.crafts["uav2"].mode = mission(flight)
    flight.run(lambda: flight.stage("uav2") is Stage.FLYING)
    assert flight.given(Resume) == [Resume("uav2", 3.0)], "the change of mode has made it forget its speed"
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_after_an_abort_no_vehicle_is_taken_from_its_pilot() -> None:
    flight = under_way(fleet_of(flight={"pilot_return": "auto"}))
    flight.crafts["uav2"].mode = LOITER["ardupilot"]
    at_s = flight.now_s
    flight.run(lambda: flight.stage("uav2") is Stage.PILOT)
    flight.happen(ReturnAllOrdered())
    flight.crafts["uav2"].mode = mission(flight)
    why = "uav2: its pilot has set mission mode, but the flight was aborted; not commanded from here"
    flight.run(lambda: why in flight.said(Level.WARNING))
    flight.pass_s(30.0)
    assert flight.stage("uav2") is Stage.PILOT
    assert told(flight, "uav2", at_s) == []
    assert flight.said(Level.WARNING).count(why) == 1


@pytest.mark.parametrize("action", [Action.RETURN, Action.HOLD])
def test_an_intent_for_a_vehicle_with_its_pilot_is_confirmed_twice(action: Action) -> None:
    flight, at_s = taken()
    first = flight.ask(action, "uav2")
    assert first.outcome is Outcome.REFUSED
    assert first.question == "uav2 is with its pilot. Take control of it? Speak to the pilot first"
    assert told(flight, "uav2", at_s) == []
    second = flight.ask(action, "uav2", confirmed=True)
    assert second.outcome is Outcome.ACCEPTED
    assert [type(command) for command in told(flight, "uav2", at_s)] == [SendHome if action is Action.RETURN else Hold]


def test_a_lost_confirmed_order_is_not_repeated_after_a_new_takeover() -> None:
    flight, _ = taken()
    lost = ReturnEnded("uav2", accepted=False, reason="change of mode: no acknowledgement", lost=True)
    flight.return_results["uav2"] = [lost]
    assert flight.ask(Action.RETURN, "uav2", confirmed=True).outcome is Outcome.ACCEPTED
    flight.crafts["uav2"].mode = 16
    flight.happen(Heard("uav2", flight.crafts["uav2"].heartbeat()))
    again_s = flight.now_s + 0.1
    flight.pass_s(60.0)
    assert flight.stage("uav2") is Stage.PILOT
    assert told(flight, "uav2", again_s) == []


def test_the_pilots_own_return_is_his() -> None:
    flight, at_s = taken(mode=6)
    assert "mode RTL; not commanded from here" in flight.said(Level.FAULT)[0]
    flight.run(lambda: flight.stage("uav2") is Stage.LANDED)
    assert told(flight, "uav2", at_s) == []
    assert flight.vehicle("uav2").orders.excluded
    flight.finish()
    assert flight.given(Start).count(Start("uav2")) == 1


def test_a_failsafe_is_no_pilot() -> None:
    flight = under_way()
    flight.happen(Heard("uav2", StatusText(2, "EKF Failsafe: position variance")))
    flight.crafts["uav2"].mode = 9
    flight.run(lambda: flight.vehicle("uav2").fault is not None)
    assert flight.stage("uav2") is Stage.RETURNING
    assert flight.sent_home() == []


def test_a_fence_breach_that_is_only_a_notice_explains_a_return() -> None:
    flight = under_way()
    flight.happen(Heard("uav2", StatusText(5, "Circle fence breached")))
    flight.crafts["uav2"].mode = 6
    flight.run(lambda: flight.vehicle("uav2").fault is not None)
    assert "fence, its fence is breached; it says: Circle fence breached" in flight.said(Level.FAULT)[0]
    assert flight.sent_home() == []
    assert "uav2 says: Circle fence breached" in flight.said(Level.WARNING)


def test_a_heartbeat_that_got_lost_is_no_silence_that_explains_a_mode() -> None:
    flight = under_way()
    seen_s = flight.vehicle("uav2").link.heartbeat_s
    assert seen_s is not None
    # Positions go on; the heartbeats of four seconds are lost.
    flight.state = flight.state.put(with_facts(flight.vehicle("uav2"), heartbeat_s=seen_s - 4.0))
    flight.crafts["uav2"].mode = 17
    flight.run(lambda: flight.stage("uav2") is not Stage.FLYING)
    assert flight.stage("uav2") is Stage.PILOT


def test_a_text_that_comes_after_the_mode_explains_it_too() -> None:
    flight = under_way()
    flight.crafts["uav2"].mode = 6
    flight.pass_s(0.8)
    flight.happen(Heard("uav2", StatusText(4, "Radio Failsafe")))
    flight.run(lambda: flight.stage("uav2") is not Stage.FLYING)
    assert flight.stage("uav2") is Stage.RETURNING


def test_a_return_home_that_its_pilot_takes_over_is_not_repeated() -> None:
    flight = under_way()
    flight.crafts["uav2"].battery_pct -= 30.0
    flight.run(lambda: flight.sent_home() == ["uav2"])
    flight.pass_s(5.0)
    flight.crafts["uav2"].mode = LOITER["ardupilot"]
    at_s = flight.now_s
    flight.pass_s(120.0)
    assert flight.stage("uav2") is Stage.PILOT
    assert told(flight, "uav2", at_s) == []


def test_an_abort_leaves_the_pilots_vehicle_to_the_pilot() -> None:
    flight, at_s = taken()
    flight.happen(ReturnAllOrdered())
    assert told(flight, "uav2", at_s) == []
    assert "uav2: is with its pilot; RTL not commanded" in flight.said(Level.WARNING)
    assert sorted(flight.sent_home()) == ["uav1", "uav3"]


def test_a_vehicle_on_its_pad_after_a_restart_was_not_landed_by_its_pilot() -> None:
    flight, _ = taken()
    craft = flight.crafts["uav2"]
    craft.mute = True
    flight.pass_s(5.0)
    craft.place_m, craft.up_m, craft.armed = flight.context.vehicles["uav2"].pad_m, 0.0, False
    for number in range(5):
        flight.happen(Heard("uav2", craft.position(1.0 + 0.4 * number)))
        flight.happen(Heard("uav2", craft.heartbeat()))
        flight.step()
    assert flight.stage("uav2") is Stage.LANDED
    assert flight.vehicle("uav2").orders.excluded
    text = "uav2: is disarmed on its pad; its autopilot has rebooted; stays there until included"
    assert text in flight.said(Level.INFO)


def test_a_vehicle_stays_with_its_pilot_after_a_link_gap() -> None:
    flight, at_s = taken()
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    flight.crafts["uav2"].mute = False
    flight.pass_s(30.0)
    assert flight.stage("uav2") is Stage.PILOT
    assert told(flight, "uav2", at_s) == []


def test_a_foreign_arming_after_the_landing_is_announced() -> None:
    flight = under_way(fleet_of({"uav1": (0,), "uav2": (2, 4, 6, 8, 10)}, flight={"fly_again": "never"}))
    flight.run(lambda: flight.stage("uav1") is Stage.LANDED)
    flight.crafts["uav1"].armed, flight.crafts["uav1"].mode = True, 0
    at_s = flight.now_s
    flight.run(lambda: flight.stage("uav1") is Stage.PILOT)
    assert flight.said(Level.FAULT)[-1] == ("uav1: armed on the ground by another source, mode STABILIZE: keep clear")
    flight.pass_s(10.0)
    assert told(flight, "uav1", at_s) == []


def test_a_takeover_during_take_off_cancels_the_start() -> None:
    flight = Story(fleet_of().context, dict(fleet_of().boards))
    flight.start_s["uav2"] = 30.0
    flight.launch()
    flight.crafts["uav2"].armed, flight.crafts["uav2"].mode = True, 4
    flight.pass_s(3.0)
    flight.crafts["uav2"].mode = 0
    at_s = flight.now_s
    flight.pass_s(60.0)
    assert flight.stage("uav2") is Stage.PILOT
    assert told(flight, "uav2", at_s) == []
