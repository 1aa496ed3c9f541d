"""Intents from the broker: accepted, refused, and their answers."""

from __future__ import annotations

import json
from typing import get_args

import pytest

from executor.adapters.mqtt.intent_intake import (
    BURST,
    MOST_BYTES,
    IntakeReason,
    IntakeRules,
    IntentIntake,
    RefusedMessage,
    read_intent,
)
from executor.core.interface.commands import Level
from executor.core.interface.intents import Action, ActionName, Intent

NOW_UNIX_S = 1_790_000_000.0  # 2026-09-21T13:33:20Z
GOOD = {"timestamp": "2026-09-21T14:13:20Z", "id": "a-1", "action": "hold", "vehicle": "uav1"}
OPEN = IntakeRules(max_age_s=10.0)


def read(rules: IntakeRules = OPEN, *, retained: bool = False, **changes: object) -> Intent | RefusedMessage:
    content = {key: value for key, value in (GOOD | changes).items() if value is not ...}
    return read_intent(json.dumps(content).encode(), rules, NOW_UNIX_S, retained=retained)


def reason(rules: IntakeRules = OPEN, *, retained: bool = False, **changes: object) -> str:
    found = read(rules, retained=retained, **changes)
    assert isinstance(found, RefusedMessage), found
    assert "\n" not in found.reason
    assert found.id == "a-1"
    return found.reason


def test_each_action_can_be_asked_for() -> None:
    assert set(get_args(ActionName)) == {one.value for one in Action}


def test_an_intent() -> None:
    assert read() == Intent("a-1", Action.HOLD, "uav1", "mqtt")
    assert read(action="abort", vehicle=...) == Intent("a-1", Action.ABORT, None, "mqtt")
    assert read(timestamp="2026-09-21T16:13:11+02:00", headerId=7, version="1.2.0") == read()


def test_assets_to_look_at_again() -> None:
    assets = ["V101-3", "pylon V101-4", 17]
    expected = Intent("a-1", Action.PROVE, None, "mqtt", assets=("V101-3", "pylon V101-4", 17))
    assert read(action="prove", vehicle=..., assets=assets) == expected
    assert reason(assets=assets) == "assets: expected none, as hold is for no single one"
    assert reason(action="prove", vehicle=..., assets=[]) == "assets: expected at least one asset"
    assert reason(action="prove", vehicle=..., assets=["V101-3", ""]).startswith("assets[1]: expected the name")


def test_a_base_is_closed_by_its_name() -> None:
    assert read(action="close", vehicle=..., base="north") == Intent("a-1", Action.CLOSE, None, "mqtt", base="north")
    assert read(action="open", vehicle=..., base="north") == Intent("a-1", Action.OPEN, None, "mqtt", base="north")
    expected = "base: expected a name for close, open and count, and none for anything else"
    assert reason(action="close", vehicle=...) == expected
    assert reason(base="north") == expected
    assert reason(action="close", base="north") == "vehicle: expected none, as close is for all of them"


def test_packs_are_counted_at_a_base() -> None:
    counted = Intent("a-1", Action.COUNT, None, "mqtt", base="north", charged=3)
    assert read(action="count", vehicle=..., base="north", charged=3) == counted
    expected = "charged: expected a number of packs for count, and none for anything else"
    assert reason(action="count", vehicle=..., base="north") == expected
    assert reason(charged=3) == expected
    assert reason(action="count", vehicle=..., charged=3).startswith("base: expected a name")
    for wrong in (-1, 1001, 2.5, "3", True):
        assert reason(action="count", vehicle=..., base="north", charged=wrong).startswith("charged: ")


def test_what_is_no_intent_is_refused_in_one_line() -> None:
    assert "unknown" in reason(colour="red") or "Extra inputs" in reason(colour="red")
    assert reason(action="loop").startswith("action: ")
    assert reason(action="abort") == "vehicle: expected none, as abort is for all of them"
    assert reason(vehicle=...) == "vehicle: expected a name, as hold is for one of them"
    assert reason(vehicle="uav 1").startswith("vehicle: ")
    assert reason(timestamp="2026-09-21T14:13:20").startswith("timestamp: ")
    assert reason(timestamp=1_790_000_000).startswith("timestamp: ")
    assert reason(version="2.0.0").startswith("version: ")
    assert reason(headerId=-1).startswith("headerId: ")


@pytest.mark.parametrize(
    "payload", [b"{", b"[]", b"\xff\xfe", b"null", b"[" * 4000, b'{"id": "\\ud800"}', b'{"id": "a\\u0000"}']
)
def test_what_is_not_even_readable(payload: bytes) -> None:
    found = read_intent(payload, OPEN, NOW_UNIX_S, retained=False)
    assert isinstance(found, RefusedMessage)
    assert found.id is None


def test_a_large_one_is_not_even_read() -> None:
    found = read_intent(json.dumps(GOOD).encode().ljust(MOST_BYTES + 1), OPEN, NOW_UNIX_S, retained=False)
    assert found == RefusedMessage(None, "expected at most 4096 bytes, got 4097", IntakeReason.INVALID)


def test_what_was_meant_for_another_moment_is_refused() -> None:
    assert reason(timestamp="2026-09-21T14:13:09Z").endswith("got one 11 s old")
    assert reason(timestamp="2026-09-21T14:13:31Z").endswith("got one 11 s ahead")
    assert reason(timestamp="0001-01-01T00:00:00+14:00").startswith("timestamp: expected at most 10 s")
    assert reason(retained=True).startswith("retained: ")
    assert isinstance(read(IntakeRules(max_age_s=60.0), timestamp="2026-09-21T14:12:30Z"), Intent)


def test_the_token() -> None:
    secret = "schlüssel"  # noqa: S105
    rules = IntakeRules(max_age_s=10.0, token=secret)
    assert isinstance(read(rules, token=secret), Intent)
    assert reason(rules).startswith("token: expected the one that the site names")
    assert "guess" not in reason(rules, token="guess")  # noqa: S106
    assert "guess" not in reason(rules, token="guess" * 60)
    assert secret not in repr(rules)


def test_where_none_are_taken_the_answer_says_why() -> None:
    assert reason(IntakeRules(max_age_s=10.0, closed="the broker is not on this computer")).endswith(
        "not on this computer"
    )


def test_a_gate_lets_a_burst_through_and_then_so_many_a_second() -> None:
    accepted, now_s = list[Intent](), [0.0]
    intake = IntentIntake(OPEN, lambda: NOW_UNIX_S, lambda: now_s[0], accepted.append, lambda _: None, lambda *_: None)
    for at_s, let_through in ((0.0, BURST), (2.0, BURST + 10), (1000.0, 2 * BURST + 10)):
        now_s[0] = at_s
        for _ in range(100):
            intake.handle_message(json.dumps(GOOD).encode(), retained=False)
        assert len(accepted) == let_through


def test_a_flood_is_counted_and_neither_answered_nor_told_in_full() -> None:
    accepted: list[Intent] = []
    refused: list[RefusedMessage] = []
    said: list[tuple[Level, str]] = []
    now_s = [0.0]
    intake = IntentIntake(
        OPEN, lambda: NOW_UNIX_S, lambda: now_s[0], accepted.append, refused.append, lambda *it: said.append(it)
    )
    intake.handle_message(b"", retained=True)
    assert (intake.refused, refused) == (0, [])
    for _ in range(1000):
        intake.handle_message(b"no", retained=False)
        intake.handle_message(json.dumps(GOOD).encode(), retained=False)
    assert len(accepted) == BURST
    assert len(refused) == BURST
    assert intake.refused == 2000 - BURST
    assert len(said) == 1
    now_s[0] = 11.0
    intake.handle_message(b"no", retained=False)
    assert f"{intake.refused} in all" in said[-1][1]
