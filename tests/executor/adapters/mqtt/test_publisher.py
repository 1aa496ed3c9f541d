"""What is published of a flight: states, telemetry, faults, plans and answers, all by their schemas."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import jsonschema
import pytest

import faultline
from executor.adapters.mqtt.client import MqttMessage, Outbox, Presence
from executor.adapters.mqtt.intent_intake import IntakeReason, RefusedMessage
from executor.adapters.mqtt.publisher import ASSETS_EVERY_S, AT_LEAST_EVERY_S, Publisher, split_plan
from executor.adapters.mqtt.topics import MqttTopics
from executor.core.fleet_view import build_fleet_view
from executor.core.imaging.asset_status import AssetState, AssetView
from executor.core.interface.commands import Level, Say
from executor.core.interface.events import IntentReceived, Tick
from executor.core.interface.intents import Action, Outcome
from missions import build_plan_document
from scripts.pages.schemas import schemas
from tests.executor.core.stories import story, under_way
from tests.executor.flights import first_plan_file
from tests.fakes.flight import Story

SITE = faultline.build_site(vehicles=3, radius_m=700)
SCHEMA_OF = {
    "connection": "connection",
    "event": "event",
    "fault": "fault",
    "plan": "plan",
    "plan-part": "plan-part",
    "ack": "acknowledgement",
    "assets": "assets",
    "telemetry": "telemetry",
}


class Desk:
    """A publisher over a story, and the messages that it wrote."""

    def __init__(self, flight: Story) -> None:
        self.flight = flight
        self.outbox = Outbox(10_000)
        self.unix_s = 1_790_000_000.0
        self.publisher = Publisher(MqttTopics("site/north"), self.outbox, "run-7", lambda: self.unix_s)

    def look(self, after_s: float = 1.0) -> list[MqttMessage]:
        """Publish the present; returns what was written."""
        self.unix_s += after_s
        self.publisher.publish_view(build_fleet_view(self.flight.context, self.flight.state, self.flight.now_s))
        return self.written()

    def written(self) -> list[MqttMessage]:
        return self.outbox.take_batch(10_000)


def content(letter: MqttMessage) -> dict[str, Any]:
    """Return a message that keeps to its schema."""
    read: dict[str, Any] = json.loads(letter.payload)
    last = letter.topic.rsplit("/", 1)[-1]
    if last.isdecimal():
        last = "plan-part"
    name = SCHEMA_OF.get(last) or ("fleet-state" if "/fleet/" in letter.topic else "vehicle-state")
    validator(name).validate(read)
    return read


@cache
def validator(name: str) -> jsonschema.Draft202012Validator:
    return jsonschema.Draft202012Validator(json.loads(schemas()[f"mqtt/{name}.schema.json"]))


def on(letters: list[MqttMessage], topic: str) -> list[dict[str, Any]]:
    """Return the messages on a topic; every one of them keeps to its schema."""
    return [content(letter) for letter in letters if letter.topic == f"site/north/v1/{topic}"]


def test_states_are_retained_and_published_on_change() -> None:
    desk = Desk(under_way())
    first = desk.look()
    kinds = {letter.topic.removeprefix("site/north/v1/"): letter.retain for letter in first}
    assert kinds == {"fleet/state": True} | {
        f"vehicle/{name}/{what}": how
        for name in ("uav1", "uav2", "uav3")
        for what, how in (("state", True), ("telemetry", False))
    }
    [state] = on(first, "vehicle/uav1/state")
    assert (state["headerId"], state["run"], state["version"]) == (0, "run-7", "1.8.0")
    assert state["timestamp"] == "2026-09-21T14:13:21.000Z"
    assert state["vehicle"]["state"] == "flying"
    assert {letter.topic.rsplit("/", 1)[-1] for letter in desk.look()} == {"telemetry"}
    assert len(on(desk.look(AT_LEAST_EVERY_S), "vehicle/uav1/state")) == 1
    # The ground station's clock is set back.
    assert len(on(desk.look(-3600.0), "vehicle/uav1/state")) == 1
    assert on(desk.look(), "vehicle/uav1/state") == []


def test_what_became_of_assets_is_published_when_it_changes_and_not_with_every_picture() -> None:
    desk = Desk(under_way())
    rows = (AssetView(0, AssetState.OPEN, 0, 10, None), AssetView(1, AssetState.OPEN, 2, 4, None))
    more = (rows[0], AssetView(1, AssetState.MISSED, 2, 4, "uav2"))

    def told(views: tuple[AssetView, ...], after_s: float, *, last: bool = False) -> list[dict[str, Any]]:
        desk.unix_s += after_s
        desk.publisher.publish_assets(lambda: views, last=last)
        return on(desk.written(), "fleet/assets")

    [first] = told(rows, 0.0)
    assert (first["assets_total"], first["run"]) == (2, "run-7")
    assert first["assets"] == [{"segment": 1, "state": "open", "pictures": 2, "asked": 4, "vehicle": None}]
    assert told(more, ASSETS_EVERY_S - 1.0) == []
    [second] = told(more, 1.0)
    assert second["assets"] == [{"segment": 1, "state": "missed", "pictures": 2, "asked": 4, "vehicle": "uav2"}]
    assert told(more, ASSETS_EVERY_S) == []
    assert len(told(rows, 1.0, last=True)) == 1
    # Of many it is a long message, which a slow line carries seldom.
    many = tuple(AssetView(number, AssetState.SEEN, 9, 10, "uav1") for number in range(1000))
    assert len(told(many, ASSETS_EVERY_S)) == 1
    assert told(rows, 5 * ASSETS_EVERY_S) == []
    assert len(told(rows, 5 * ASSETS_EVERY_S)) == 1


def test_a_flight_with_a_loss_is_published_whole() -> None:
    flight = story()
    desk = Desk(flight)
    flight.run(lambda: len(flight.state.coverage.inspected) == 1)
    flight.crafts["uav3"].mute = True
    letters: list[MqttMessage] = []
    while not flight.over:
        flight.step()
        desk.publisher.publish_event(Tick(), flight.state)
        letters += desk.look(0.4)
    [fault] = on(letters, "fleet/fault")
    assert (fault["vehicle"], fault["kind"]) == ("uav3", "link")
    states = on(letters, "fleet/state")
    assert any(state["replan"] is not None for state in states)
    assert states[-1]["finished"]
    assert sorted(states[-1]["inspected"]) == [0, 1, 2, 3, 4, 5]
    assert [state["headerId"] for state in states] == list(range(len(states)))
    assert len(states) < 60
    assert "lost" in [one["vehicle"]["state"] for one in on(letters, "vehicle/uav3/state")]
    assert {one["segment"] for one in on(letters[::5], "vehicle/uav1/telemetry")} > {0, 1}


def test_an_intent_is_answered_and_answered_again() -> None:
    flight = under_way()
    desk = Desk(flight)
    record = flight.ask(Action.HOLD, "uav2")
    asked = IntentReceived(record.intent)
    desk.publisher.publish_event(asked, flight.state)
    [answer] = on(desk.written(), "intent/ack")
    assert (answer["id"], answer["action"], answer["vehicle"]) == (record.intent.id, "hold", "uav2")
    assert answer["outcome"] == "accepted"
    flight.run(lambda: flight.outcome(record).outcome is Outcome.DONE)
    desk.publisher.publish_event(Tick(), flight.state)
    assert [one["outcome"] for one in on(desk.written(), "intent/ack")] == ["done"]
    flight.happen(asked)
    desk.publisher.publish_event(asked, flight.state)
    desk.publisher.publish_event(Tick(), flight.state)
    assert [one["text"] for one in on(desk.written(), "intent/ack")] == ["it holds"]
    desk.publisher.publish_refusal(RefusedMessage(None, "not JSON", IntakeReason.INVALID))
    assert [(one["outcome"], one["code"]) for one in on(desk.written(), "intent/ack")] == [("refused", "invalid")]


@pytest.mark.parametrize("state", list(Presence))
def test_presence(state: Presence) -> None:
    letter = Desk(story()).publisher.build_presence(state)
    assert (letter.topic, letter.retain) == ("site/north/v1/fleet/connection", True)
    assert content(letter)["connectionState"] == state.value


def test_lines_and_plans() -> None:
    desk = Desk(story())
    desk.publisher.publish_line(Say(Level.FAULT, "uav2: lost"), 12.5)
    desk.publisher.publish_line(Say(Level.INFO, "re-plan 1"), 13.0)
    document = build_plan_document(first_plan_file())
    desk.publisher.publish_plan(0, document)
    letters = desk.written()
    assert [(one["level"], one["at_s"]) for one in on(letters, "fleet/event")] == [("fault", 12.5), ("info", 13.0)]
    [plan] = on(letters, "fleet/plan")
    assert plan["parts"] == 1
    assert plan["plan"] == json.loads(json.dumps(document))


def large(segments: int) -> dict[str, Any]:
    """Return a plan of a priced network with so many segments."""
    document: dict[str, Any] = json.loads(
        json.dumps(build_plan_document(faultline.plan(SITE, iterations=500, starts=1)))
    )
    rows = range(segments)
    for holder, key in ((document, "segments"), (document["model"], "tracks_m")):
        known = holder[key]
        holder[key] = [known[number % len(known)] for number in rows]
    document["segments"] = [{**one, "id": number} for number, one in enumerate(document["segments"])]
    return document


def joined(first: dict[str, Any], parts: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the plan of its parts, as docs/mqtt.md says."""
    plan: dict[str, Any] = first["plan"]
    for part in parts:
        plan["segments"] += part["segments"]
        plan["model"]["tracks_m"] += part["tracks_m"]
    return plan


def test_a_large_plan_comes_in_parts_that_clouds_take_and_old_parts_are_forgotten() -> None:
    desk = Desk(story())
    document = large(600)
    desk.publisher.publish_plan(3, document)
    letters = desk.written()
    assert all(len(one.payload) < 128_000 and one.retain for one in letters)
    [first] = on(letters, "fleet/plan")
    parts = [on(letters, f"fleet/plan/{number}")[0] for number in range(2, first["parts"] + 1)]
    assert len(letters) == first["parts"] == 3
    assert [(one["revision"], one["part"], one["parts"]) for one in parts] == [(3, 2, 3), (3, 3, 3)]
    assert first["plan"]["segments"]
    assert joined(first, parts) == document
    desk.publisher.publish_plan(4, large(300))
    letters = desk.written()
    assert {one.topic.rpartition("/v1/")[2]: len(one.payload) > 0 for one in letters} == {
        "fleet/plan": True, "fleet/plan/2": True, "fleet/plan/3": False,
    }  # fmt: skip
    assert desk.outbox.list_retained() == ("site/north/v1/fleet/plan", "site/north/v1/fleet/plan/2")


@pytest.mark.parametrize("most_bytes", [1, 3000, 10**6])
def test_a_plan_is_the_same_however_it_is_split(most_bytes: int) -> None:
    document = json.loads(json.dumps(build_plan_document(first_plan_file())))  # of the paper's model: without tracks
    plan, *more = split_plan(document, most_bytes)
    assert len(more) == {1: 5, 3000: 1, 10**6: 0}[most_bytes]
    for part in more:
        plan["segments"] += part["segments"]
        assert part["tracks_m"] == []
    assert plan == document
