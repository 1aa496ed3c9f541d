"""MQTT as an AsyncAPI document: topics, senders, retained messages, and the JSON schemas of the payloads."""

from __future__ import annotations

import inspect
import json
from dataclasses import dataclass

from executor.adapters.mqtt import publisher
from executor.adapters.mqtt.client import QOS
from executor.adapters.mqtt.topics import MqttTopics
from scripts.pages.schemas import MESSAGES

PLACE = "mqtt/asyncapi.json"
TOPICS = MqttTopics("{prefix}")
PARAMETERS = {
    "prefix": {"description": "The site's `mqtt.prefix`.", "default": "faultline"},
    "vehicle": {"description": "Name of the vehicle, as in the site file."},
    "part": {"description": "Number of the part, from 2 on.", "examples": ["2"]},
}


@dataclass(frozen=True, slots=True)
class Channel:
    """One topic."""

    message: str
    """Name of its schema."""
    address: str
    retained: bool = False
    sent: bool = True
    """Sent by faultline; False for received topics."""


CHANNELS = (
    Channel("connection", TOPICS.fleet_topic("connection"), retained=True),
    Channel("fleet-state", TOPICS.fleet_topic("state"), retained=True),
    Channel("assets", TOPICS.fleet_topic("assets"), retained=True),
    Channel("plan", TOPICS.fleet_topic("plan"), retained=True),
    Channel("plan-part", f"{TOPICS.fleet_topic('plan')}/{{part}}", retained=True),
    Channel("event", TOPICS.fleet_topic("event")),
    Channel("fault", TOPICS.fleet_topic("fault")),
    Channel("vehicle-state", TOPICS.vehicle_topic("{vehicle}", "state"), retained=True),
    Channel("telemetry", TOPICS.vehicle_topic("{vehicle}", "telemetry")),
    Channel("intent", TOPICS.intent_topic, sent=False),
    Channel("acknowledgement", TOPICS.acknowledgement_topic),
)


def asyncapi_document() -> str:
    """Return the document as text."""
    servers = {
        "plain": {"host": "broker.example.org:1883", "protocol": "mqtt", "description": "The site's own broker."},
        "tls": {"host": "broker.example.org:8883", "protocol": "secure-mqtt", "description": "The same with TLS."},
    }
    document = {
        "asyncapi": "3.0.0",
        "info": {
            "title": "faultline over MQTT",
            "version": publisher.VERSION,
            "description": "A flight as it is published, and the intents that it takes. An empty retained message says "
            "that the broker holds nothing more on its topic.",
            "license": {"name": "Apache-2.0"},
        },
        "defaultContentType": "application/json",
        "servers": servers,
        "channels": {one.message: _channel(one) for one in CHANNELS},
        "operations": {one.message: _operation(one) for one in CHANNELS},
    }
    return json.dumps(document, indent=1) + "\n"


def _channel(one: Channel) -> dict[str, object]:
    model = MESSAGES[one.message]
    payload = {"$ref": f"./{one.message}.schema.json"}
    known = {name: told for name, told in PARAMETERS.items() if f"{{{name}}}" in one.address}
    message = {"name": model.__name__, "summary": " ".join(inspect.cleandoc(model.__doc__ or "").split())}
    return {"address": one.address, "messages": {one.message: {**message, "payload": payload}}, "parameters": known}


def _operation(one: Channel) -> dict[str, object]:
    return {
        "action": "send" if one.sent else "receive",
        "channel": {"$ref": f"#/channels/{one.message}"},
        "bindings": {"mqtt": {"qos": QOS, "retain": one.retained, "bindingVersion": "0.2.0"}},
    }
