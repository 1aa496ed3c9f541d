"""The AsyncAPI document, and the how-tos of other programs, held to what a flight really publishes and takes."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

from executor.adapters.mqtt.client import Presence
from executor.adapters.mqtt.intent_intake import IntentMessage
from executor.core.interface.commands import Level, Say
from missions import build_plan_document
from scripts.pages.asyncapi import CHANNELS, asyncapi_document
from scripts.pages.schemas import MESSAGES, schemas
from tests.executor.adapters.mqtt.test_publisher import Desk, large
from tests.executor.core.stories import story, under_way
from tests.executor.flights import first_plan_file

ROOT = Path(__file__).parents[3]
DOCUMENT: dict[str, Any] = json.loads(asyncapi_document())
HOW_TO = ROOT / "docs" / "how-to"
PREFIX = "site/north"


def channel_of(topic: str) -> str:
    """Return the one channel that a topic belongs to."""
    found = [
        name
        for name, channel in DOCUMENT["channels"].items()
        if re.fullmatch(re.sub(r"\\{\w+\\}", "[^/]+", re.escape(channel["address"].replace("{prefix}", PREFIX))), topic)
    ]
    assert len(found) == 1, f"{topic}: {found}"
    return str(found[0])


def published() -> dict[str, bool]:
    """Return the channels of all that a flight with a loss publishes, and whether each is retained."""
    desk = Desk(story())
    letters = [desk.publisher.build_presence(Presence.ONLINE), *desk.look()]
    desk.publisher.publish_line(Say(Level.INFO, "launched"), 1.0)
    desk.publisher.publish_plan(0, build_plan_document(first_plan_file()))
    desk.publisher.publish_plan(1, large(300))
    letters += desk.written()
    return {channel_of(letter.topic): letter.retain for letter in letters}


def test_every_message_is_on_one_channel_with_its_schema() -> None:
    assert {one.message for one in CHANNELS} == set(MESSAGES)
    assert len(CHANNELS) == len(MESSAGES)
    for name, channel in DOCUMENT["channels"].items():
        [message] = channel["messages"].values()
        assert f"mqtt/{message['payload']['$ref'].removeprefix('./')}" in schemas(), name
        assert message["name"] == MESSAGES[name].__name__
        assert set(re.findall(r"{(\w+)}", channel["address"])) == set(channel["parameters"])


def test_what_is_published_is_where_and_as_it_says() -> None:
    found = published()
    assert set(found) >= {"connection", "fleet-state", "vehicle-state", "telemetry", "event", "plan", "plan-part"}
    told = {name: one["bindings"]["mqtt"]["retain"] for name, one in DOCUMENT["operations"].items()}
    assert {name: told[name] for name in found} == found


def test_intents_alone_are_taken() -> None:
    actions = {name: one["action"] for name, one in DOCUMENT["operations"].items()}
    assert {name for name, action in actions.items() if action == "receive"} == {"intent"}
    assert set(actions.values()) == {"send", "receive"}


def test_its_topics_are_those_of_the_page() -> None:
    page = (ROOT / "docs" / "mqtt.md").read_text(encoding="utf-8")
    named = {"{vehicle}": "NAME", "{part}": "2"}
    for channel in DOCUMENT["channels"].values():
        topic = channel["address"].removeprefix("{prefix}/v1/")
        for parameter, word in named.items():
            topic = topic.replace(parameter, word)
        assert f"| `{topic}`" in page


def keys_of(name: str) -> set[str]:
    """Return the keys of a message as Telegraf names them: nested ones joined by `_`."""
    schema = json.loads(schemas()[f"mqtt/{name}.schema.json"])
    found = set(schema["properties"])
    for key, held in schema["properties"].items():
        for one in (held, *held.get("anyOf", ())):
            nested = schema.get("$defs", {}).get(one.get("$ref", "").rpartition("/")[2], {})
            found |= {f"{key}_{inner}" for inner in nested.get("properties", {})}
    return found


def test_telegrafs_file_names_topics_and_keys_that_there_are() -> None:
    page = (HOW_TO / "grafana.md").read_text(encoding="utf-8")
    [block] = re.findall(r"```ini\n(.*?)```", page, re.DOTALL)
    inputs = tomllib.loads(block)["inputs"]["mqtt_consumer"]
    assert len(inputs) == 2
    for one in inputs:
        [topic] = one["topics"]
        keys = keys_of(channel_of(topic.replace("faultline/", f"{PREFIX}/").replace("+", "uav1")))
        named = {*one["tag_keys"], *one["json_string_fields"], one["json_time_key"]}
        assert named <= keys, topic
    assert {"battery_pct", "position_relative_alt_m", "link_loss"} <= keys_of("telemetry")


def test_node_reds_flow_names_topics_that_there_are_and_sends_an_intent() -> None:
    page = (HOW_TO / "node-red.md").read_text(encoding="utf-8")
    [block] = re.findall(r"```json\n(.*?)```", page, re.DOTALL)
    flow = {one["id"]: one for one in json.loads(block)}
    told = [(one["type"], one["topic"].replace("faultline/", f"{PREFIX}/")) for one in flow.values() if "topic" in one]
    expected = {("mqtt in", "event"), ("mqtt in", "acknowledgement"), ("mqtt out", "intent")}
    assert {(kind, channel_of(topic)) for kind, topic in told} == expected
    wired = {end for one in flow.values() for wires in one.get("wires", []) for end in wires}
    assert wired <= set(flow)
    [content] = re.findall(r"payload = (\{.*?\});", flow["intent"]["func"])
    sent = dict(re.findall(r"(\w+): ('[^']*'|[^,}]+)", content))
    assert set(sent) == {"timestamp", "id", "action", "vehicle"}
    asked = {key: sent[key].strip("'") for key in ("action", "vehicle")}
    intent = {"timestamp": "2026-11-21T15:04:05Z", "id": "node-red-1", **asked}
    IntentMessage.model_validate_json(json.dumps(intent))


def test_a_flight_under_way_keeps_to_it_too() -> None:
    desk = Desk(under_way())
    assert {channel_of(letter.topic) for letter in desk.look()} == {"fleet-state", "vehicle-state", "telemetry"}
