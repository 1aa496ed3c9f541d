"""Site-file keys of [mqtt] and [web]: where a flight is published, and which senders of intents are accepted."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from executor.site.site_keys import EnvironmentName, FileName, HostName, SiteTable


class MqttTable(SiteTable):
    """The MQTT broker that publishes the flight and delivers intents."""

    host: HostName = "127.0.0.1"
    """Host name or address of the broker."""
    port: Annotated[int, Field(ge=1, le=65535)] | None = None
    """Port of the broker. Default: 1883, with TLS 8883; over a websocket 80, with TLS 443."""
    protocol: Literal["3.1.1", "5"] = "3.1.1"
    """MQTT version."""
    websocket_path: Annotated[str, Field(max_length=1000, pattern=r"^/[!-~]*$")] | None = None
    """Connect over a websocket at this path, such as `/mqtt`; without it over TCP."""
    prefix: Annotated[str, Field(max_length=100, pattern=r"^[A-Za-z0-9_.-]+(/[A-Za-z0-9_.-]+)*$")] = "faultline"
    """First part of all topics; flights published at the same time need different ones."""
    telemetry_rate_hz: Annotated[float, Field(gt=0, le=10)] = 1.0
    """How often telemetry is published, in real time."""
    tls: bool = False
    """Connect with TLS."""
    ca_file: FileName | None = None
    """CA certificate of the broker (PEM), relative to the site file; without it the system's own are trusted."""
    cert_file: FileName | None = None
    """Client certificate (PEM, with its chain) to show the broker, relative to the site file."""
    key_file: FileName | None = None
    """Its private key (PEM), relative to the site file; without it the key is in `cert_file`."""
    key_password_env: EnvironmentName | None = None
    """Environment variable that holds the passphrase of the private key, if it has one."""
    username_env: EnvironmentName | None = None
    """Environment variable that holds the user name at the broker."""
    password_env: EnvironmentName | None = None
    """Environment variable that holds the password; needs `username_env`."""
    token_env: EnvironmentName | None = None
    """Environment variable that holds the token which every intent must carry."""
    intent_max_age_s: Annotated[float, Field(gt=0, le=3600)] = 10.0
    """Intents whose timestamp differs by more than this from the ground station's clock are refused."""
    clear_retained: bool = False
    """Whether to clear all retained messages but `fleet/connection` at the end of the flight."""

    def _find_errors(self) -> Iterator[str]:
        for key in ("ca_file", "cert_file"):
            if getattr(self, key) is not None and not self.tls:
                yield f"{key}: expected none without tls = true"
        for key in ("key_file", "key_password_env"):
            if getattr(self, key) is not None and self.cert_file is None:
                yield f"{key}: expected a cert_file with it"
        if self.password_env is not None and self.username_env is None:
            yield "password_env: expected a username_env with it"

    @property
    def used_port(self) -> int:
        """Port, or the protocol's default."""
        usual = {(False, False): 1883, (False, True): 8883, (True, False): 80, (True, True): 443}
        return self.port or usual[self.websocket_path is not None, self.tls]

    @property
    def is_here(self) -> bool:
        """Whether the broker's name is that of this computer alone."""
        try:
            return self.host == "localhost" or ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False


class WebTable(SiteTable):
    """The operator's page of a flight."""

    enabled: bool = True
    """Whether the page is served at all."""
    host: str = "127.0.0.1"
    """Address to listen on: `0.0.0.0` for phones in the field, which needs `token_env`."""
    port: Annotated[int, Field(ge=0, le=65535)] = 0
    """Port to listen on; 0 takes a free one, and the address is printed."""
    token_env: Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")] | None = None
    """Environment variable with the token that browsers must show."""
    names: tuple[str, ...] = ()
    """Additional host names under which browsers may open the page."""
    address: Annotated[str, Field(pattern=r"^https?://[^\s/?#]+/$")] | None = None
    """Address to print, where browsers reach the page under another one, such as `http://127.0.0.1:8080/` for a
    container's published port or a proxy."""

    def _find_errors(self) -> Iterator[str]:
        try:
            address = ipaddress.ip_address(self.host)
        except ValueError:
            yield f"host: expected an address such as 127.0.0.1 or 0.0.0.0, got '{self.host}'"
            return
        if not address.is_loopback and self.token_env is None:
            yield (
                f"token_env: expected the name of an environment variable with a token, because host {self.host} can "
                "be reached by others"
            )
