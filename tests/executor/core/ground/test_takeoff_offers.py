"""A landed vehicle takes off again only after the crew's confirmation."""

from __future__ import annotations

from executor.core.interface.commands import Level, Start
from executor.core.interface.events import Heard
from executor.core.interface.intents import Action, Outcome
from executor.core.interface.messages import Attitude, StatusText
from executor.core.replanning.survivors import build_survivor
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import fleet_of
from tests.executor.core.stories import EVERYTHING, story
from tests.fakes.flight import Story

UNEQUAL = {"uav1": (0,), "uav2": (4, 6, 8, 10), "uav3": (2,)}
ASK: dict[str, object] = {"fly_again": "ask"}


def one_left(**flight: object) -> Story:
    """Return a flight in which uav1 and uav3 have landed and uav2 is lost with work left."""
    told = story(fleet_of(UNEQUAL, flight={**ASK, **flight}))
    told.crafts["uav2"].speed = 0.9  # the others are down while it has two segments left
    told.run(lambda: told.stage("uav1") is Stage.LANDED and told.stage("uav3") is Stage.LANDED)
    told.crafts["uav2"].mute = True
    told.run(lambda: told.stage("uav2") is Stage.LOST)
    return told


def starts(flight: Story, name: str) -> int:
    return flight.given(Start).count(Start(name))


def test_no_take_off_without_confirmation() -> None:
    flight = one_left(offer_s=120)
    lost_s = flight.now_s
    flight.finish()
    assert (starts(flight, "uav1"), starts(flight, "uav3")) == (1, 1)
    assert 115.0 < flight.now_s - lost_s < 130.0
    assert flight.said(Level.WARNING)[-1].startswith("no vehicle was cleared for take-off within 120 s")
    assert len(flight.state.coverage.inspected) < 6


def test_the_offer_names_vehicles_and_pads() -> None:
    flight = one_left()
    flight.run(lambda: flight.state.crew.offer is not None)
    line = flight.said(Level.FAULT)[-1]
    assert line.startswith("uav1 and uav3 can take over ")
    assert "Are their pads clear of people?" in line


def test_an_included_vehicle_takes_off_and_finishes() -> None:
    flight = one_left()
    flight.run(lambda: flight.state.crew.offer is not None)
    asked = flight.ask(Action.INCLUDE, "uav3")
    assert asked.question == "uav3 may take off once its mission is uploaded. Is its pad clear of people?"
    assert starts(flight, "uav3") == 1
    assert flight.ask(Action.INCLUDE, "uav3", confirmed=True).outcome is Outcome.DONE
    flight.finish()
    assert (starts(flight, "uav1"), starts(flight, "uav3")) == (1, 2)
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_vehicles_cleared_at_the_same_time_share_the_segments() -> None:
    flight = one_left()
    flight.run(lambda: flight.state.crew.offer is not None)
    flight.ask(Action.INCLUDE, "uav1", confirmed=True)
    flight.pass_s(5.0)
    flight.ask(Action.INCLUDE, "uav3", confirmed=True)
    flight.finish()
    assert (starts(flight, "uav1"), starts(flight, "uav3")) == (2, 2)
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_vehicles_that_returned_by_their_own_failsafe_do_not_take_off_again() -> None:
    flight = story(fleet_of(flight=ASK))
    flight.run(lambda: flight.inspecting("uav2", 2))
    for name in flight.crafts:
        flight.happen(Heard(name, StatusText(4, "GCS Failsafe")))
        flight.crafts[name].go_home()
    flight.finish()
    assert [starts(flight, name) for name in flight.crafts] == [1, 1, 1]


def test_an_abort_ends_an_offer() -> None:
    flight = one_left()
    flight.run(lambda: flight.state.crew.offer is not None)
    record = flight.ask(Action.ABORT)
    assert (record.outcome, record.text) == (Outcome.DONE, "no vehicle is on its mission; no further take-off")
    flight.pass_s(1.0)
    assert flight.over


def test_a_spare_is_offered_too() -> None:
    flight = story(fleet_of({"uav1": (), "uav2": (2, 4, 6, 8, 10, 0)}, flight=ASK))
    flight.run(lambda: flight.inspecting("uav2", 2))
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.state.crew.offer is not None)
    assert starts(flight, "uav1") == 0
    flight.ask(Action.INCLUDE, "uav1", confirmed=True)
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_tipped_vehicle_is_not_offered() -> None:
    flight = one_left()
    flight.happen(Heard("uav1", Attitude(170.0, 0.0)))
    flight.pass_s(1.0)
    assert flight.state.crew.offer is not None
    assert flight.state.crew.offer.vehicles == ("uav3",)


def test_a_tipped_vehicle_gets_nothing_where_take_offs_are_automatic() -> None:
    flight = one_left(fly_again="auto")
    flight.happen(Heard("uav1", Attitude(0.0, 90.0)))
    assert build_survivor(flight.context, flight.state, flight.vehicle("uav1"), flight.now_s) is None
    assert build_survivor(flight.context, flight.state, flight.vehicle("uav3"), flight.now_s) is not None
