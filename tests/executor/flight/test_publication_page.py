"""The page of a flight by the site file: its address, and its environment variables."""

from __future__ import annotations

import asyncio

import httpx
import pytest

from executor.adapters.clock import SystemClock
from executor.core.fleet_step import build_initial_state
from executor.core.interface.commands import Level
from executor.core.interface.intents import Action, Intent, Outcome
from executor.core.state.fleet_state import FleetState
from executor.errors import SiteError
from executor.flight import publication as web
from executor.runtime.flight_loop import Flight, Observer
from executor.site.mqtt_and_web_keys import WebTable
from executor.site.site_file import check_site
from tests.executor.builders import fleet_of, with_facts
from tests.fakes.solver import FakeSolver
from tests.patience import PATIENCE_S
from tests.ports import free_port

SITE = {
    "network": {"file": "line"},
    "vehicle": [{"name": "uav1", "connection": "udpin://127.0.0.1:14550", "sysid": 1, "autopilot": "px4"}],
}
VARIABLE = "FIELD_TOKEN"


class Lines:
    """A console that keeps what is said."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def say(self, level: Level, text: str, at_s: float | None = None) -> None:
        self.lines.append(text)


class Nowhere:
    """A log that keeps nothing."""

    def write(self, event: object, now_s: float) -> None:
        pass

    async def settle(self) -> None:
        pass


def flight_of(clock: SystemClock, launched_s: float | None = None) -> Flight:
    ready = fleet_of()

    def nothing(*_: object) -> None:
        pass

    state: FleetState = with_facts(build_initial_state(dict(ready.boards)), launched_s=launched_s)
    return Flight(ready.context, state, {}, clock, Nowhere(), FakeSolver(), Observer(nothing, nothing))


def test_by_default_it_is_on_for_this_computer_alone() -> None:
    table = check_site(SITE, "test").web
    assert (table.enabled, table.host, table.port, table.token_env) == (True, "127.0.0.1", 0, None)


@pytest.mark.parametrize(
    ("web", "expected"),
    [
        ({"host": "0.0.0.0"}, "test: web.token_env: expected the name of an environment variable"),  # noqa: S104
        ({"host": "::"}, "test: web.token_env: expected the name of an environment variable with a token"),
        ({"host": "field-laptop"}, "test: web.host: expected an address such as 127.0.0.1 or 0.0.0.0"),
        ({"port": 70000}, "test: web.port: expected"),
        ({"token_env": "a token, not its name"}, "test: web.token_env: expected"),
        ({"ports": 80}, "test: web.ports: unknown key"),
    ],
)
def test_what_it_cannot_be_is_named(web: dict[str, object], expected: str) -> None:
    with pytest.raises(SiteError) as raised:
        check_site({**SITE, "web": web}, "test")
    assert str(raised.value).startswith(expected)


@pytest.mark.asyncio
async def test_the_address_of_a_published_port_is_what_is_printed_and_answered_to() -> None:
    clock, lines, port = SystemClock(1.0), Lines(), free_port()
    table = WebTable(address="http://ground.example:8123/", port=port)
    async with web.serve_page(table, flight_of(clock), clock, lines):
        assert lines.lines == ["page: http://ground.example:8123/"]
        async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}") as client:
            for name, status in (("ground.example:8123", 200), ("elsewhere.example:8123", 421)):
                assert (await client.get("/", headers={"host": name})).status_code == status


@pytest.mark.asyncio
async def test_a_wish_goes_through_the_flights_own_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    token = "0123456789abcdef"  # noqa: S105 - of this test alone
    monkeypatch.setenv(VARIABLE, token)
    clock, lines = SystemClock(1.0), Lines()
    flight = flight_of(clock, launched_s=0.0)
    async with web.serve_page(WebTable(token_env=VARIABLE), flight, clock, lines):
        [line] = lines.lines
        assert line.endswith(f"/?token=${VARIABLE}")
        address = line.removeprefix("page: ").partition("?")[0]
        async with httpx.AsyncClient(base_url=address) as client:
            body = {"id": "w1", "action": "hold"}
            assert (await client.post("/intents", json=body)).status_code == 401
            client.headers["authorization"] = f"Bearer {token}"
            answer = await client.post("/intents", json=body)
            assert answer.json()["text"].startswith("hold needs a vehicle")
            assert set(flight.state.crew.intents) == {"w1"}


def looked_at(address: str) -> tuple[list[list[int]], httpx.Response]:
    """Look at the page and ask for something."""
    with httpx.Client(base_url=address, timeout=PATIENCE_S) as client:
        routes = [vehicle["route"]["segments"] for vehicle in client.get("/chart").json()["vehicles"]]
        return routes, client.post("/intents", json={"id": "w1", "action": "abort"})


@pytest.mark.asyncio
async def test_before_the_take_off_it_shows_the_plan_and_refuses_every_wish() -> None:
    """The operator is being asked: nothing asked now, but the answer, may happen after the yes."""
    clock, lines = SystemClock(1.0), Lines()
    flight = flight_of(clock)
    async with web.serve_page(WebTable(), flight, clock, lines):
        routes, answer = await asyncio.to_thread(looked_at, lines.lines[0].removeprefix("page: "))
    assert routes == [[0, 1], [2, 3], [4, 5]]
    assert (answer.status_code, answer.json()["text"]) == (409, "the flight has not begun")
    assert flight.state.crew.intents["w1"].outcome is Outcome.REFUSED
    flight.submit_intent(Intent("w2", Action.ABORT, None, "terminal"))
    assert flight.state.crew.intents["w2"].text == "the flight has not begun"


@pytest.mark.asyncio
async def test_a_port_that_is_taken_does_not_stop_a_flight() -> None:
    clock, lines = SystemClock(1.0), Lines()
    flight = flight_of(clock)
    async with web.serve_page(WebTable(), flight, clock, lines):
        port = int(lines.lines[0].rstrip("/").rpartition(":")[2])
        async with web.serve_page(WebTable(port=port), flight, clock, lines):
            await asyncio.sleep(0)
    assert lines.lines[1].endswith("the flight continues without its page")


@pytest.mark.asyncio
async def test_a_page_that_is_not_wanted_is_not_there() -> None:
    lines = Lines()
    clock = SystemClock(1.0)
    async with web.serve_page(WebTable(enabled=False), flight_of(clock), clock, lines):
        assert lines.lines == []
