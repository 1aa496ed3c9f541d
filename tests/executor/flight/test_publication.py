"""How a site's broker is read, and that no mistake in what is told of a flight reaches the flight."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from cryptography.hazmat.primitives import serialization

from executor.adapters.clock import SystemClock
from executor.core.fleet_view import FleetView
from executor.core.imaging.asset_status import AssetView
from executor.core.interface.commands import Level, Say
from executor.core.interface.events import Tick
from executor.core.state.fleet_state import FleetState
from executor.errors import SiteError
from executor.flight.publication import Publication
from executor.flight.run_start import MqttSettings, read_mqtt_settings
from executor.site.mqtt_and_web_keys import MqttTable
from executor.supervised import watch_internal_errors
from missions import build_plan_document
from tests.brokers import secured_in
from tests.executor.flights import first_plan_file
from tests.ports import free_port

DOCUMENT = (Path(__file__).parents[3] / "docs" / "mqtt.md").read_text(encoding="utf-8")
SECRETS = {"BROKER_USER": "crew", "BROKER_PASSWORD": "p4ss", "CREW_TOKEN": "t0ken"}


def settings(base: Path = Path(), environment: dict[str, str] | None = None, **table: object) -> MqttSettings:
    made = read_mqtt_settings(MqttTable.model_validate(table), base, "site.toml", environment or {})
    assert made is not None
    return made


def documented(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", DOCUMENT, re.DOTALL)


def test_a_site_without_a_broker() -> None:
    assert read_mqtt_settings(None, Path(), "site.toml", {}) is None


def test_the_documented_table(tmp_path: Path) -> None:
    secured_in(tmp_path).authority.rename(tmp_path / "broker-ca.pem")
    table = tomllib.loads(documented("toml")[0])["mqtt"] | {"tls": True, "host": "broker"}
    read = settings(tmp_path, SECRETS, **table)
    assert str(read.broker) == "broker:8883"
    assert (read.broker.username, read.broker.password, read.rules.token) == ("crew", "p4ss", "t0ken")
    assert read.broker.tls is not None
    assert read.rules.closed == ""
    shown = repr(read)
    assert "p4ss" not in shown
    assert "t0ken" not in shown


def test_the_documented_messages_keep_to_their_schemas() -> None:
    folder = Path(__file__).parents[3] / "docs" / "mqtt"
    for name, message in zip(("assets", "telemetry"), documented("json"), strict=True):
        schema = json.loads((folder / f"{name}.schema.json").read_text(encoding="utf-8"))
        jsonschema.validate(json.loads(message), schema)
    linked = set(re.findall(r"\(mqtt/([a-z.-]+)\)", DOCUMENT))
    assert linked == {path.name for path in folder.iterdir()}


def test_tls_has_a_port_of_its_own(tmp_path: Path) -> None:
    assert settings(tls=True).broker.port == 8883
    assert settings().broker.port == 1883
    with pytest.raises(
        SiteError, match=r"^site.toml: mqtt.ca_file: expected a certificate \(PEM\) in none.pem: No such"
    ):
        settings(tmp_path, tls=True, ca_file="none.pem")
    (tmp_path / "noise.pem").write_text("noise", encoding="utf-8")
    with pytest.raises(SiteError, match=r"^site.toml: mqtt.ca_file: expected a certificate"):
        settings(tmp_path, tls=True, ca_file="noise.pem")


def test_a_websocket_has_the_ports_of_the_web() -> None:
    asked: dict[str, Any] = {"host": "broker", "websocket_path": "/mqtt"}
    tables: tuple[dict[str, Any], ...] = ({}, {"tls": True}, {"port": 8083})
    assert [settings(**asked, **more).broker.port for more in tables] == [80, 443, 8083]
    assert settings(**asked).broker.websocket_path == "/mqtt"
    assert (settings(protocol="5").broker.protocol, settings().broker.protocol) == ("5", "3.1.1")


def test_a_clients_certificate_and_what_is_none(tmp_path: Path) -> None:
    secured = secured_in(tmp_path)
    assert settings(tmp_path, tls=True, cert_file="client.pem").broker.tls is not None
    assert settings(tmp_path, tls=True, cert_file="broker.pem", key_file="broker.key").broker.tls is not None
    key = serialization.load_pem_private_key(secured.key.read_bytes(), None)
    locked = serialization.BestAvailableEncryption(b"kites at noon")
    pem = (serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8)
    (tmp_path / "locked.key").write_bytes(key.private_bytes(*pem, locked))
    asked: dict[str, Any] = {
        "tls": True,
        "cert_file": "broker.pem",
        "key_file": "locked.key",
        "key_password_env": "WORD",
    }
    assert settings(tmp_path, {"WORD": "kites at noon"}, **asked).broker.tls is not None
    wrong: dict[str, dict[str, Any]] = {
        "in none.pem: No such file": {"cert_file": "none.pem"},
        "in broker.pem: ": {"cert_file": "broker.pem"},
        "in broker.pem and none.key: No such file": {"cert_file": "broker.pem", "key_file": "none.key"},
        "in client.pem and broker.key: KEY_VALUES_MISMATCH": {"cert_file": "client.pem", "key_file": "broker.key"},
        "in broker.pem and locked.key: ": {"cert_file": "broker.pem", "key_file": "locked.key"},
    }
    for said, table in wrong.items():
        line = f"site.toml: mqtt.cert_file: expected a certificate and its private key (PEM) {said}"
        with pytest.raises(SiteError, match=f"^{re.escape(line)}[^\n]*$"):
            settings(tmp_path, tls=True, **table)
    with pytest.raises(SiteError, match=r"KEY_VALUES_MISMATCH|BAD_DECRYPT|locked\.key"):
        settings(tmp_path, {"WORD": "guessed"}, **asked)
    with pytest.raises(SiteError, match=r"^site.toml: mqtt.key_password_env: expected a value in .* WORD"):
        settings(tmp_path, **asked)


def test_a_secret_that_is_not_set() -> None:
    with pytest.raises(SiteError, match=r"^site.toml: mqtt.username_env: expected a value in .* BROKER_USER"):
        settings(username_env="BROKER_USER")


def test_when_intents_are_taken() -> None:
    assert settings().rules.closed == ""
    assert settings(host="broker").rules.closed == "the broker is not on this computer, and the site names no token_env"
    assert settings(token_env="T").rules.closed == "the environment variable T is not set"  # noqa: S106
    assert settings(host="broker", environment={"T": "x"}, token_env="T").rules.closed == ""  # noqa: S106
    assert settings(environment={"T": ""}, token_env="T").rules.token is None  # noqa: S106


def test_secrets_in_the_clear_are_warned_of() -> None:
    environment = {"T": "x", "U": "y"}
    assert settings(host="broker", environment=environment, token_env="T").exposed  # noqa: S106
    assert settings(host="broker", environment=environment, username_env="U").exposed
    assert not settings(host="broker").exposed
    assert not settings(host="broker", tls=True, environment=environment, token_env="T").exposed  # noqa: S106
    assert not settings(environment=environment, token_env="T").exposed  # noqa: S106


@pytest.mark.asyncio
async def test_no_mistake_reaches_the_flight(tmp_path: Path) -> None:
    """Nor does a broker that is not there; each is said once, of wherever it is."""
    publication = Publication(settings(port=free_port(), telemetry_rate_hz=10.0), tmp_path, SystemClock())
    said: list[tuple[Level, str]] = []

    def broken() -> FleetView:
        raise ZeroDivisionError("a mistake")

    def assets() -> tuple[AssetView, ...]:
        raise ZeroDivisionError("a mistake")

    publication.publish(lambda to: to.publish_plan(0, build_plan_document(first_plan_file())))
    with watch_internal_errors(lambda text: said.append((Level.FAULT, text)), None):
        async with publication.run(broken, lambda _: None, lambda *line: said.append(line), assets):
            for _ in range(3):
                publication.publish(lambda to: to.publish_event(Tick(), FleetState({})))
                publication.publish(lambda to: to.publish_line(Say(Level.INFO, "a line"), 1.0))
                publication.publish(lambda to: to.publish_line(Say(Level.INFO, "another"), float("nan")))
    assert said == [
        *[(Level.FAULT, "internal error in mqtt: ZeroDivisionError: a mistake")] * 2,
        (Level.WARNING, said[-1][1]),
    ]
    assert "messages never reached 127.0.0.1:" in said[-1][1]
