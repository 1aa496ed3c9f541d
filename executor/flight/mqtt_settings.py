"""What a site says of its broker, read before anything is connected."""

from __future__ import annotations

import os
import ssl
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from secrets import token_hex

from executor.adapters.extras import Extra, require_extra
from executor.adapters.mqtt.broker import BrokerAddress, IntakeRules, MqttTopics
from executor.errors import SiteError
from executor.site.flight_tables import MqttTable
from executor.site.site_file import read_secret


@dataclass(frozen=True, slots=True)
class MqttSettings:
    """What a site says of its broker."""

    topics: MqttTopics
    broker: BrokerAddress
    rules: IntakeRules
    period_s: float
    """Of telemetry, in real seconds."""
    exposed: bool
    """Whether secrets leave this computer without TLS."""


def read_mqtt_settings(
    table: MqttTable | None, base: Path, source: str, environment: Mapping[str, str] = os.environ
) -> MqttSettings | None:
    """Return what a site says of its broker, with the secrets that it names; None if it has none.

    Args:
        table: The site's table.
        base: The folder that the site file's paths are relative to.
        source: The site file, for messages.
        environment: Where the secrets are.

    Raises:
        ExtraMissing: there is a broker, and nothing installed to speak to it with.
        SiteError: a secret is not set, or the authority's certificate cannot be used.
    """
    if table is None:
        return None
    require_extra(Extra.MQTT, f"[mqtt] in {source}")
    broker = BrokerAddress(
        table.host,
        table.port or (8883 if table.tls else 1883),
        # The same at every connection of this flight, and nobody else's.
        f"faultline-{token_hex(6)}",
        read_secret(table.username_env, "mqtt.username_env", source, environment),
        read_secret(table.password_env, "mqtt.password_env", source, environment),
        _build_tls_context(table, base, source),
    )
    token = (environment.get(table.token_env) if table.token_env is not None else None) or None
    exposed = not table.is_here and not table.tls and (token, broker.username, broker.password) != (None, None, None)
    return MqttSettings(
        MqttTopics(table.prefix), broker, _build_rules(table, token), 1.0 / table.telemetry_rate_hz, exposed
    )


def _build_rules(table: MqttTable, token: str | None) -> IntakeRules:
    closed = ""
    if token is None and table.token_env is not None:
        closed = f"the environment variable {table.token_env} is not set"
    elif token is None and not table.is_here:
        closed = "the broker is not on this computer, and the site names no token_env"
    return IntakeRules(table.intent_max_age_s, token, closed)


def _build_tls_context(table: MqttTable, base: Path, source: str) -> ssl.SSLContext | None:
    if not table.tls:
        return None
    try:
        return ssl.create_default_context(cafile=None if table.ca_file is None else str(base / table.ca_file))
    except (OSError, ssl.SSLError) as error:
        why = error.strerror or type(error).__name__
        text = f"{source}: mqtt.ca_file: expected a certificate (PEM) in {table.ca_file}: {why}"
        raise SiteError(text) from error
