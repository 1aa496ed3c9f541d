"""Texts and strangers in any number make a bounded number of lines, and what matters is among them."""

from __future__ import annotations

from executor.core import fleet_step
from executor.core.interface.commands import Level, Say
from executor.core.interface.events import Heard, Tick
from executor.core.interface.messages import ComponentText, DoubleHeard, StationActed, StationHeard, StatusText
from executor.core.telemetry.status_texts import MAX_LINES, WINDOW_S, TextRank
from executor.core.telemetry.vehicle_identity import MAX_SYSTEMS
from tests.executor.builders import with_facts
from tests.executor.core.stories import FLEET, story
from tests.fakes.flight import Story

WARNINGS, IMPORTANT = MAX_LINES[TextRank.WARNING], MAX_LINES[TextRank.IMPORTANT]


class Words:
    """The lines about uav1, as time passes by hand."""

    def __init__(self) -> None:
        self.state, self.now_s = fleet_step.build_initial_state(FLEET.boards), 100.0
        self.lines: list[str] = []

    def say(self, *texts: StatusText | ComponentText) -> None:
        for text in texts:
            self._happen(Heard("uav1", text))

    def wait(self, seconds: float) -> None:
        self.now_s += seconds
        self._happen(Tick())

    def _happen(self, event: Heard | Tick) -> None:
        self.state, decided = fleet_step.step(FLEET.context, self.state, event, self.now_s)
        self.lines += [one.text for one in decided if isinstance(one, Say) and one.text.startswith("uav1")]


def many(count: int, severity: int = 4) -> list[StatusText]:
    return [StatusText(severity, f"text {number}") for number in range(count)]


def test_a_thousand_texts_are_a_few_lines_and_a_count() -> None:
    words = Words()
    words.say(*many(1000))
    words.wait(WINDOW_S / 2)
    assert words.lines == [f"uav1 says: text {number}" for number in range(WARNINGS)]
    words.wait(WINDOW_S / 2)
    assert words.lines[WARNINGS:] == [f"uav1: {1000 - WARNINGS} more texts in 10 s"]
    words.wait(WINDOW_S)
    assert len(words.lines) == WARNINGS + 1


def test_what_is_critical_is_shown_beside_a_flood() -> None:
    words = Words()
    words.say(*many(500), StatusText(2, "Motor 3 stopped"), *many(500), StatusText(6, "Battery Failsafe"))
    assert words.lines[WARNINGS:] == ["uav1 says: Motor 3 stopped", "uav1 says: Battery Failsafe"]


def test_a_flood_of_critical_texts_is_bounded_too_and_takes_no_room_from_the_next_window() -> None:
    words = Words()
    words.say(*many(1000, severity=0))
    assert len(words.lines) == IMPORTANT
    words.now_s += WINDOW_S
    words.say(StatusText(0, "one more"))
    assert words.lines[IMPORTANT:] == [f"uav1: {1000 - IMPORTANT} more texts in 10 s", "uav1 says: one more"]


def test_a_text_left_out_is_shown_when_it_is_repeated() -> None:
    words = Words()
    words.say(*many(WARNINGS + 1))
    words.wait(WINDOW_S)
    words.say(StatusText(4, f"text {WARNINGS}"))
    assert words.lines[-2:] == ["uav1: 1 more text in 10 s", f"uav1 says: text {WARNINGS}"]


def test_words_of_another_component_are_shown_as_its_own_and_raise_nothing() -> None:
    flight = story()
    flight.happen(Heard("uav1", ComponentText(154, 0, "Crash: Disarming")))
    flight.happen(Heard("uav1", ComponentText(154, 6, "hello")))
    assert [line for line in flight.said() if "says" in line] == ["uav1, its component 154 says: Crash: Disarming"]
    assert flight.state.vehicles["uav1"].telemetry.alarm[0] == ""
    assert flight.said(Level.FAULT) == []


def test_words_of_another_component_are_no_sign_of_life() -> None:
    flight = story()
    vehicle = flight.state.vehicles["uav1"]
    later_s = flight.now_s + 100.0
    state, _ = fleet_step.step(flight.context, flight.state, Heard("uav1", ComponentText(154, 4, "I am here")), later_s)
    assert with_facts(state.vehicles["uav1"], texts=vehicle.telemetry.texts) == vehicle


def strangers(flight: Story) -> list[str]:
    return [line for line in flight.said() if "ground station is on its link" in line]


def test_two_hundred_strangers_are_a_few_lines_and_no_room_is_taken_from_a_second_vehicle() -> None:
    flight = story()
    for system in range(2, 202):
        flight.happen(Heard("uav1", StationHeard(system, 190)))
    assert len(strangers(flight)) == MAX_SYSTEMS
    assert strangers(flight)[-1].endswith("component 190; further ones are not listed")
    assert "not named" not in strangers(flight)[-2]
    assert len(flight.state.vehicles["uav1"].link.strangers) == MAX_SYSTEMS
    flight.happen(Heard("uav1", DoubleHeard(1, ("A", "B"))))
    assert "uav1: sysid 1 is used at A and B: duplicate system id" in flight.said()


def behind(flight: Story) -> list[str]:
    return [line for line in flight.said() if line.startswith("[forward]")]


def test_a_forwarded_station_is_reported_once_and_so_are_frames_not_forwarded() -> None:
    flight = story()
    refused = StationActed(255, 190, "asks for streams: not passed on", passed=False)
    for vehicle in ("uav1", "uav2", "uav1"):
        flight.happen(Heard(vehicle, StationHeard(255, 190, behind=True)))
        flight.happen(Heard(vehicle, refused))
    assert behind(flight) == [
        "[forward]: ground station heard, system 255 component 190",
        "[forward]: the ground station of system 255 component 190 asks for streams: not passed on",
    ]
    assert strangers(flight) == []


def test_what_a_station_does_to_a_vehicle_is_reported_of_that_vehicle_each_time() -> None:
    flight = story()
    for _ in range(2):
        flight.happen(Heard("uav2", StationActed(255, 190, "sets RTL_ALT to 3000")))
    flight.happen(Heard("uav1", StationActed(0, 0, "tcpout://127.0.0.1:5760 is lost; it is opened again")))
    assert [line for line in flight.said() if "ground station of" in line] == [
        "uav2: the ground station of system 255 component 190 sets RTL_ALT to 3000"
    ] * 2
    assert behind(flight) == ["[forward]: tcpout://127.0.0.1:5760 is lost; it is opened again"]


def test_what_a_station_does_is_no_sign_of_life_of_its_vehicle() -> None:
    flight = story()
    before = flight.state.vehicles["uav1"]
    flight.happen(Heard("uav1", StationActed(255, 190, "sets RTL_ALT to 3000")))
    assert flight.state.vehicles["uav1"].link == before.link


def test_a_dozen_important_lines_half_of_that_warnings_and_three_of_other_components() -> None:
    floods: list[tuple[list[StatusText] | list[ComponentText], int]] = [
        ([StatusText(2, f"text {number}") for number in range(20)], 12),
        ([StatusText(4, f"text {number}") for number in range(20)], 6),
        ([ComponentText(154, 4, f"text {number}") for number in range(20)], 3),
    ]
    for flood, most in floods:
        words = Words()
        words.say(*flood)
        assert len(words.lines) == most


def test_what_is_less_than_a_warning_is_not_shown() -> None:
    words = Words()
    words.say(StatusText(5, "a notice"), ComponentText(154, 5, "a notice"))
    assert words.lines == []
    words.say(StatusText(4, "a warning"), ComponentText(154, 4, "a warning"))
    assert len(words.lines) == 2


def test_each_rank_has_its_own_room() -> None:
    words = Words()
    words.say(*[StatusText(3, f"error {number}") for number in range(20)])
    words.say(*[ComponentText(154, 2, f"aboard {number}") for number in range(20)])
    words.say(*[StatusText(2, f"critical {number}") for number in range(20)])
    assert [sum(word in line for line in words.lines) for word in ("error", "aboard", "critical")] == [6, 3, 12]
