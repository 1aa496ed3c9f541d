"""Which component speaks for a system."""

from __future__ import annotations

import pytest

from executor.core.interface.messages import ComponentText, Heartbeat, Radio, StationHeard, StatusText
from executor.core.telemetry.vehicle_identity import (
    AutopilotComponent,
    select_component_message,
    update_autopilot_component,
)

BEAT = Heartbeat(3, 0, armed=True, system_status=4, vehicle_type=2)
GIMBAL, COMPUTER = 154, 191


def after(*beats: tuple[int, Heartbeat]) -> int:
    speaker = AutopilotComponent()
    for component, beat in beats:
        speaker = update_autopilot_component(speaker, component, beat)
    return speaker.component


def test_the_first_component_speaks_whoever_else_was_heard_first() -> None:
    assert after() == 1
    assert after((1, BEAT), (GIMBAL, BEAT)) == 1
    assert after((GIMBAL, BEAT), (1, BEAT)) == 1
    assert after((GIMBAL, BEAT), (1, BEAT), (GIMBAL, BEAT)) == 1


def test_an_autopilot_with_another_component_id_counts_and_a_later_one_does_not() -> None:
    assert after((2, BEAT), (3, BEAT), (2, BEAT)) == 2


@pytest.mark.parametrize(("autopilot", "kind"), [(0, 2), (1, 2), (8, 2), (3, 26), (12, 18), (3, None)])
def test_what_is_no_autopilot_of_a_vehicle_does_not_speak(autopilot: int, kind: int | None) -> None:
    assert after((COMPUTER, Heartbeat(autopilot, 0, armed=False, system_status=4, vehicle_type=kind))) == 1


def test_of_others_words_are_heard_as_theirs_and_nothing_else_is() -> None:
    assert select_component_message(AutopilotComponent(), GIMBAL, BEAT) is None
    assert select_component_message(AutopilotComponent(), GIMBAL, StatusText(0, "no motor")) == ComponentText(
        GIMBAL, 0, "no motor"
    )
    for about_the_link in (Radio(1, 2, 3, 4, 5), StationHeard(254, 190)):
        assert select_component_message(AutopilotComponent(), GIMBAL, about_the_link) == about_the_link
    assert select_component_message(AutopilotComponent(GIMBAL), GIMBAL, BEAT) == BEAT
