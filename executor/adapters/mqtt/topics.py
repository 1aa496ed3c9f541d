"""Address of the broker and names of all topics; docs/mqtt.md describes them."""

from __future__ import annotations

import ssl
from dataclasses import dataclass, field
from typing import Literal

MAJOR = "v1"


@dataclass(frozen=True, slots=True)
class BrokerAddress:
    """Where the broker is, and what it wants to know."""

    host: str
    port: int
    identifier: str
    """Client id, constant over reconnects, so that the broker ends the previous connection and its last will."""
    username: str | None = None
    password: str | None = field(default=None, repr=False)
    tls: ssl.SSLContext | None = None
    protocol: Literal["3.1.1", "5"] = "3.1.1"
    websocket_path: str | None = None
    """None for plain TCP."""

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


@dataclass(frozen=True, slots=True)
class MqttTopics:
    """Where everything is published under a prefix."""

    prefix: str

    def __str__(self) -> str:
        """Return what all topics begin with."""
        return f"{self.prefix}/{MAJOR}"

    def vehicle_topic(self, name: str, what: Literal["state", "telemetry"]) -> str:
        """Return a vehicle's topic."""
        return f"{self}/vehicle/{name}/{what}"

    def fleet_topic(self, what: Literal["state", "connection", "event", "fault", "plan", "assets"]) -> str:
        """Return a topic of the whole flight."""
        return f"{self}/fleet/{what}"

    def plan_part_topic(self, part: int) -> str:
        """Return where the second part of a plan, or a later one, is published."""
        return f"{self.fleet_topic('plan')}/{part}"

    @property
    def intent_topic(self) -> str:
        """Return where intents are taken from."""
        return f"{self}/intent"

    @property
    def acknowledgement_topic(self) -> str:
        """Return where they are answered."""
        return f"{self}/intent/ack"
