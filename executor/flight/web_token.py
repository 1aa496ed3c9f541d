"""The token of the page: what the environment must hold before a flight."""

from __future__ import annotations

import os

from executor.errors import SiteError
from executor.site.mqtt_and_web_keys import WebTable

LEAST_TOKEN = 16
"""Characters: shorter ones can be guessed."""


def check_web(table: WebTable) -> None:
    """Check what the environment must hold, and load the server, before anything is connected: loading takes long.

    Raises:
        SiteError: the token is missing or too short.
    """
    if table.enabled:
        read_token(table)
        import executor.adapters.web  # noqa: F401 - a third of a second in which no vehicle would be heard


def read_token(table: WebTable) -> str | None:
    """Return the token that browsers must show; None where none is asked for.

    Raises:
        SiteError: it is missing or too short.
    """
    if table.token_env is None:
        return None
    value = os.environ.get(table.token_env, "")
    if (
        len(value) < LEAST_TOKEN
        or not value.isascii()
        or not value.isprintable()
        or not value.replace("-", "").isalnum()
    ):
        raise SiteError(
            f"web.token_env: expected a token of {LEAST_TOKEN} or more letters, digits or hyphens in the environment "
            f"variable {table.token_env}"
        )
    return value
