"""The token of the page is long enough before anything is connected."""

from __future__ import annotations

import pytest

from executor.errors import SiteError
from executor.flight.publication import check_web
from executor.site.mqtt_and_web_keys import WebTable

VARIABLE = "FIELD_TOKEN"


@pytest.mark.parametrize(
    "value", [None, "", "short", "sixteen characters!", "with spaces in it all", "ümläutsÜÄÖümläuts"]
)
def test_a_token_that_is_missing_or_can_be_guessed(monkeypatch: pytest.MonkeyPatch, value: str | None) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    if value is not None:
        monkeypatch.setenv(VARIABLE, value)
    table = WebTable(host="0.0.0.0", token_env=VARIABLE)  # noqa: S104 - nothing listens
    with pytest.raises(SiteError, match=rf"^web\.token_env: expected a token of 16 or more .* variable {VARIABLE}$"):
        check_web(table)
    check_web(table.model_copy(update={"enabled": False}))
