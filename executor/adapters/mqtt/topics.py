"""Address of the broker and names of all topics; docs/mqtt.md describes them."""

from __future__ import annotations

import ssl
from dataclasses import dataclass, field
from typing import Literal

MAJOR = "v1"


@dataclass(frozen=True, slots=True)
class BrokerAddress:
    """Address and settings of the broker."""

    host: str
    port: int
    identifier: str
    """Client id, constant over reconnects, so that the broker ends the previous connection and its last will."""
    username: str | None = None
    password: str | None = field(default=None, repr=False)
    tls: ssl.SSLContext | None = None
    protocol: Literal["3.1.1", "5"] = "3.1.1"
    websocket_path: str | None = None
    """WebSocket path; None for plain TCP."""

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


@dataclass(frozen=True, slots=True)
class MqttTopics:
    """Topics under a prefix."""

    prefix: str

    def __str__(self) -> str:
        """Return the common prefix of all topics."""
        return f"{self.prefix}/{MAJOR}"

    def vehicle_topic(self, name: str, what: Literal["state", "telemetry"]) -> str:
        """Return a vehicle's topic."""
        return f"{self}/vehicle/{name}/{what}"

    def fleet_topic(self, what: Literal["state", "connection", "event", "fault", "plan", "assets"]) -> str:
        """Return a topic of the whole flight."""
        return f"{self}/fleet/{what}"

    def plan_part_topic(self, part: int) -> str:
        """Return the topic of a plan's second or later part."""
        return f"{self.fleet_topic('plan')}/{part}"

    @property
    def intent_topic(self) -> str:
        """Return the topic for intents."""
        return f"{self}/intent"

    @property
    def acknowledgement_topic(self) -> str:
        """Return the topic for acknowledgements."""
        return f"{self}/intent/ack"
