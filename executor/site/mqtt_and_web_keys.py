"""The keys of [mqtt] and [web] of a site file: where a flight is shown, and who may send intents."""

from __future__ import annotations

import ipaddress
from typing import Annotated

from pydantic import Field, model_validator

from executor.site.site_keys import EnvironmentName, FileName, HostName, SiteTable


class MqttTable(SiteTable):
    """The MQTT broker where the flight is published and intents are taken from."""

    host: HostName = "127.0.0.1"
    """Host name or address of the broker."""
    port: Annotated[int, Field(ge=1, le=65535)] | None = None
    """Port of the broker; without it 1883, and 8883 with TLS."""
    prefix: Annotated[str, Field(max_length=100, pattern=r"^[A-Za-z0-9_.-]+(/[A-Za-z0-9_.-]+)*$")] = "faultline"
    """First part of all topics; flights that are published at the same time need one each."""
    telemetry_rate_hz: Annotated[float, Field(gt=0, le=10)] = 1.0
    """How often telemetry is published, in real time."""
    tls: bool = False
    """Connect with TLS."""
    ca_file: FileName | None = None
    """CA certificate of the broker (PEM), relative to the site file; without it the system's own are trusted."""
    username_env: EnvironmentName | None = None
    """Environment variable that holds the user name at the broker."""
    password_env: EnvironmentName | None = None
    """Environment variable that holds the password; needs `username_env`."""
    token_env: EnvironmentName | None = None
    """Environment variable that holds the token which every intent must carry."""
    intent_max_age_s: Annotated[float, Field(gt=0, le=3600)] = 10.0
    """Intents whose timestamp is further than this from the ground station's clock are refused."""

    @model_validator(mode="after")
    def _check_credentials(self) -> MqttTable:
        if self.ca_file is not None and not self.tls:
            raise ValueError("ca_file: expected none without tls = true")
        if self.password_env is not None and self.username_env is None:
            raise ValueError("password_env: expected a username_env beside it")
        return self

    @property
    def is_here(self) -> bool:
        """Whether the broker is reached from this computer alone, as far as its name tells."""
        try:
            return self.host == "localhost" or ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False


class WebTable(SiteTable):
    """The page to fly by."""

    enabled: bool = True
    """Whether the page is served at all."""
    host: str = "127.0.0.1"
    """Address to listen on: `0.0.0.0` for phones in the field; then `token_env` is needed."""
    port: Annotated[int, Field(ge=0, le=65535)] = 0
    """Port to listen on; 0 takes a free one, and the address is printed."""
    token_env: Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")] | None = None
    """Environment variable that holds the token which browsers must show."""
    names: tuple[str, ...] = ()
    """Further host names under which browsers may call the page."""
    address: Annotated[str, Field(pattern=r"^https?://[^\s/?#]+/$")] | None = None
    """Where browsers reach the page if that is another address, such as `http://127.0.0.1:8080/`: the published port of
    a container, a proxy. It is printed instead."""

    @model_validator(mode="after")
    def _check_exposure(self) -> WebTable:
        try:
            address = ipaddress.ip_address(self.host)
        except ValueError:
            raise ValueError(f"host: expected an address such as 127.0.0.1 or 0.0.0.0, got '{self.host}'") from None
        if not address.is_loopback and self.token_env is None:
            raise ValueError(
                f"token_env: expected the name of an environment variable with a token, because host {self.host} can "
                "be reached by others"
            )
        return self
