"""How answers are written down, so that only what an autopilot does counts, and not how fast a computer is."""

from __future__ import annotations

from tests.dialogues.answer import Heard, fold
from tests.dialogues.words import texts


def asked(*requests: tuple[float, int]) -> list[Heard]:
    return [Heard(at_s, 0.0, f"MISSION_REQUEST {seq}", seq) for at_s, seq in requests]


def test_a_row_of_requests_is_one_line() -> None:
    assert fold(asked((0.0, 0), (0.1, 1), (0.2, 2))) == ("MISSION_REQUEST 0..2",)


def test_a_question_repeated_before_its_answer_came_is_no_other_answer() -> None:
    assert fold(asked((0.0, 0), (0.3, 0), (0.4, 1), (0.5, 2))) == ("MISSION_REQUEST 0..2",)


def test_a_question_that_stays_open_shows_how_often_it_is_asked() -> None:
    assert fold(asked((0.0, 3), (1.0, 3), (2.04, 3), (2.97, 3))) == ("MISSION_REQUEST 3, again every 1 s",)
    assert fold(asked((0.0, 3), (1.0, 3))) == ("MISSION_REQUEST 3, again",)


def test_another_answer_ends_the_row_and_its_lateness_is_reported() -> None:
    heard = [*asked((0.0, 0), (0.1, 1)), Heard(8.2, 8.1, "MISSION_ACK ERROR"), *asked((8.3, 2))]
    assert fold(heard) == ("MISSION_REQUEST 0..1", "MISSION_ACK ERROR after 8 s", "MISSION_REQUEST 2")


def test_answers_that_come_twice_are_counted() -> None:
    twice = [Heard(0.0, 0.0, "DO_SET_MODE ACCEPTED"), Heard(0.1, 0.1, "DO_SET_MODE ACCEPTED")]
    assert fold(twice) == ("DO_SET_MODE ACCEPTED, 2 times",)


def test_texts_lose_what_is_measured_in_them_and_those_that_answer_nothing() -> None:
    said = [
        "Climb to 14.9 meters above home\t",
        "EKF3 IMU0 is using GPS",
        "Arm: Accels inconsistent",
        "Arm: EKF is bad",
    ]
    assert texts(said) == ("Climb to # meters above home", "Arm: #")
