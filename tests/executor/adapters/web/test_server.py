"""The server of a flight: its data, its access checks, and that no client delays the flight."""

from __future__ import annotations

import asyncio
import json
import socket
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
import uvicorn
from hypothesis import given, settings
from hypothesis import strategies as st

from executor.adapters.web.guard import ConnectionLimits, EventStream, LatestValue, cookie_name_for
from executor.adapters.web.page_server import STATIC, TYPES, WebSettings
from executor.adapters.web.server import WebServer
from executor.adapters.web.snapshot import Describe
from executor.core.fleet_view import FleetView, build_fleet_view
from executor.core.interface.events import IntentReceived
from executor.core.interface.intents import Action, Intent, IntentRecord, Outcome
from executor.errors import ConnectionFailed
from tests.executor.core.stories import under_way
from tests.fakes.flight import Story
from tests.patience import PATIENCE_S

TOKEN = "field-laptop-42-of-north"  # noqa: S105 - shown to the server of these tests alone
HOLD = {"id": "wish-1", "action": "hold", "vehicle": "uav2"}


class Beside:
    """A flight with its server."""

    def __init__(
        self,
        token: str | None = None,
        *,
        port: int = 0,
        decides: bool = True,
        describe: Describe = build_fleet_view,
        limits: ConnectionLimits | None = None,
    ) -> None:
        self.mistakes: list[str] = []
        self.flight: Story = under_way()
        self.asked: list[Intent] = []
        self.decides = decides
        settings = WebSettings("127.0.0.1", port, token)
        self.server = WebServer(
            settings, self.flight.context, lambda: (self.flight.state, self.flight.now_s), self.submit, describe,
            lambda what, error: self.mistakes.append(f"{what}: {type(error).__name__}: {error}"), limits,
        )  # fmt: skip

    def submit(self, intent: Intent) -> Future[IntentRecord]:
        done: Future[IntentRecord] = Future()
        if not self.decides:
            return done
        self.asked.append(intent)
        self.flight.happen(IntentReceived(intent))
        done.set_result(self.flight.state.crew.intents[intent.id])
        return done

    def client(self, **headers: str) -> httpx.Client:
        return httpx.Client(base_url=self.server.address, headers=headers, timeout=PATIENCE_S)

    @property
    def port(self) -> int:
        return int(self.server.address.rstrip("/").rpartition(":")[2])


@contextmanager
def serving(token: str | None = None) -> Iterator[Beside]:
    beside = Beside(token)
    with beside.server:
        yield beside


@pytest.fixture(scope="module")
def open_one() -> Iterator[Beside]:
    """A server that only this computer can reach."""
    with serving() as beside:
        yield beside


@pytest.fixture(scope="module")
def guarded() -> Iterator[Beside]:
    """A server that asks for a token."""
    with serving(TOKEN) as beside:
        yield beside


def test_the_page_and_its_files(open_one: Beside) -> None:
    files = [file for file in Path(str(STATIC)).iterdir() if file.suffix in TYPES]
    assert {"page.css", "page.js", "icon.svg"} <= {file.name for file in files}
    with open_one.client() as client:
        page = client.get("/")
        assert page.status_code == 200
        assert "default-src 'none'" in page.headers["content-security-policy"]
        for file in files:
            answer = client.get(f"/files/{file.name}")
            assert (answer.status_code, answer.headers["content-type"]) == (200, TYPES[file.suffix])
        assert client.get("/files/page.html").status_code == 404
        assert client.get("/files/server.py").status_code == 404
        assert client.get("/files/..%2fserver.py").status_code == 404
    named = [file.read_text(encoding="utf-8") for file in (*files, Path(str(STATIC), "page.html"))]
    assert not any("http://" in text.replace("http://www.w3.org/2000/svg", "") or "https://" in text for text in named)


def test_the_present_at_once(open_one: Beside) -> None:
    with open_one.client() as client:
        state, chart = client.get("/state").json(), client.get("/chart").json()
    assert [vehicle["name"] for vehicle in state["vehicles"]] == ["uav1", "uav2", "uav3"]
    assert state["segments_total"] == len(chart["segments_m"]) == 6
    [_, second, _] = chart["vehicles"]
    assert second["route"]["segments"] == [2, 3]
    assert len(second["route"]["inspect"]) == len(second["route"]["places_m"])


def test_what_became_of_assets_is_asked_for_when_it_is_another() -> None:
    with serving() as beside, beside.client() as client:
        first, chart = client.get("/state").json()["assets"], client.get("/chart").json()
        assert (chart["pictures"], chart["assets"]) == (False, [[number, 0] for number in range(6)])
        assert client.get("/state").json()["assets"] == first
        told = client.get("/assets").json()
        assert told["assets"] == first
        done = beside.flight.state.coverage.inspected
        assert told["rows"] == [[segment, "seen", 0, done[segment]] for segment in sorted(done)]
        beside.flight.run(lambda: len(beside.flight.state.coverage.inspected) > len(done))
        later = client.get("/state").json()["assets"]
        assert later > first
        again = client.get("/assets").json()
        assert (again["assets"], len(again["rows"])) == (later, len(beside.flight.state.coverage.inspected))


def test_states_follow_each_other_within_a_second(open_one: Beside) -> None:
    with open_one.client() as client, client.stream("GET", "/events") as stream:
        assert stream.headers["content-type"].startswith("text/event-stream")
        lines = (line for line in stream.iter_lines() if line.startswith("data: "))
        shown_s = [json.loads(next(lines).removeprefix("data: "))["now_s"]]
        open_one.flight.pass_s(1.2)
        # the server looks whenever its second is over, so a state of the way there may be shown first
        while shown_s[-1] < open_one.flight.now_s - 0.01:
            shown_s.append(json.loads(next(lines).removeprefix("data: "))["now_s"])
    assert shown_s == sorted(shown_s)
    assert shown_s[-1] == pytest.approx(shown_s[0] + 1.2, abs=0.01)


def test_an_open_page_sees_the_end_and_is_disconnected() -> None:
    with serving() as beside, beside.client() as client, client.stream("GET", "/events") as stream:
        lines = (line for line in stream.iter_lines() if line.startswith("data: "))
        next(lines)
        beside.flight.finish()
        beside.server.__exit__(None, None, None)
        *_, last = lines
    assert json.loads(last.removeprefix("data: "))["finished"]
    assert beside.mistakes == []


def test_the_clock_and_the_names_of_the_spans(open_one: Beside) -> None:
    with open_one.client() as client:
        state, clock, chart = (client.get(path).json() for path in ("/state", "/clock", "/chart"))
    assert clock == {"now_s": pytest.approx(open_one.flight.now_s, abs=0.01)}
    assert (state["speedup"], state["decided_age_s"]) == (1.0, pytest.approx(0.0, abs=0.01))
    assert chart["names"] == [f"segment {segment}" for segment in range(6)]


def test_an_intent_and_its_answer() -> None:
    with serving() as beside, beside.client() as client:
        first = client.post("/intents", json=HOLD)
        assert (first.status_code, first.json()["outcome"]) == (202, "accepted")
        again = client.post("/intents", json=HOLD)
        assert again.json() == first.json()
        assert beside.asked[0] == Intent("wish-1", Action.HOLD, "uav2", "page")
        beside.flight.run(lambda: beside.flight.state.crew.intents["wish-1"].outcome is Outcome.DONE)
        assert client.get("/state").json()["intents"][-1]["text"] == "it holds"
        refused = client.post("/intents", json={"id": "wish-2", "action": "hold", "vehicle": "uav2"})
        assert refused.json()["code"] == "on_hold"
        assert (refused.status_code, refused.json()["outcome"]) == (409, "refused")
        assert refused.json()["text"] == "it holds already"


@pytest.mark.parametrize(
    "body",
    [
        b"", b"[]", b"{", b"null", b"\xff\xfe", b'{"id":"a","action":"explode"}', b'{"id":"a","action":"hold","x":1}',
        b'{"id":"","action":"abort"}', b'{"id":7,"action":"abort"}', b'{"id":"a b","action":"abort"}',
        b'{"id":"a","action":"hold","vehicle":["uav1"]}', b'{"id":"a","action":"hold","vehicle":NaN}',
        b"[" * 2000,
    ],
)  # fmt: skip
def test_what_is_no_intent_is_named_and_changes_nothing(open_one: Beside, body: bytes) -> None:
    before = len(open_one.asked)
    with open_one.client() as client:
        answer = client.post("/intents", content=body, headers={"content-type": "application/json"})
    assert answer.status_code == 422
    assert len(open_one.asked) == before


def test_assets_to_look_at_again_come_as_they_are(open_one: Beside) -> None:
    wish = {"id": "look-1", "action": "prove", "assets": ["no such", 2]}
    with open_one.client() as client:
        answer = client.post("/intents", json=wish)
        held = client.post("/intents", json={**wish, "action": "hold", "vehicle": "uav2"})
    assert open_one.asked[-1] == Intent("look-1", Action.PROVE, None, "page", assets=("no such", 2))
    found = answer.json()
    assert (answer.status_code, found["code"], found["assets"]) == (409, "asset_unknown", ["no such", 2])
    assert (held.status_code, held.text) == (422, "assets: expected none, as hold is for no single one")


@given(body=st.binary(max_size=200) | st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=8), lambda inner: st.dictionaries(
        st.sampled_from(["id", "action", "vehicle", "x"]), inner | st.sampled_from(["hold", "abort", "uav1"]),
        max_size=4,
    ), max_leaves=6,
).map(lambda value: json.dumps(value).encode()))  # fmt: skip
@settings(max_examples=60, deadline=None)
def test_no_body_breaks_the_server(open_one: Beside, body: bytes) -> None:
    with open_one.client() as client:
        answer = client.post("/intents", content=body, headers={"content-type": "application/json"})
    assert answer.status_code in {200, 202, 409, 422}


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"origin": "http://evil.example"}, 403),
        ({"origin": "null"}, 403),
        ({"sec-fetch-site": "cross-site"}, 403),
        ({"sec-fetch-site": "same-site"}, 403),
        ({"host": "evil.example"}, 421),
        ({"host": "127.0.0.1.evil.example:80"}, 421),
        ({"content-type": "text/plain"}, 415),
        ({"content-type": "application/x-www-form-urlencoded"}, 415),
    ],
)
def test_another_pages_request_is_not_taken(open_one: Beside, headers: Mapping[str, str], status: int) -> None:
    before = len(open_one.asked)
    with open_one.client() as client:
        given = {"content-type": "application/json", **headers}
        answer = client.post("/intents", content=json.dumps(HOLD), headers=given)
    assert answer.status_code == status
    assert len(open_one.asked) == before


def test_our_own_pages_request_is_taken(open_one: Beside) -> None:
    for name in ("127.0.0.1", "localhost"):
        own = {
            "origin": f"http://{name}:{open_one.port}",
            "host": f"{name}:{open_one.port}",
            "sec-fetch-site": "same-origin",
        }
        with open_one.client(**own) as client:
            answer = client.post("/intents", json={"id": f"own-{name}", "action": "resume", "vehicle": "uav1"})
        assert answer.status_code == 409


LINK = {"sec-fetch-site": "same-site", "sec-fetch-mode": "navigate", "sec-fetch-dest": "document"}


@pytest.mark.parametrize(
    ("path", "changes", "status"),
    [
        ("/", {}, 200),
        ("/state", {}, 403),
        ("/files/page.js", {}, 403),
        ("/", {"sec-fetch-dest": "iframe"}, 403),
        ("/", {"sec-fetch-mode": "no-cors"}, 403),
        ("/", {"sec-fetch-site": "cross-site"}, 403),
        ("/", {"origin": "http://127.0.0.1:1"}, 403),
    ],
)
def test_a_link_of_this_computer_opens_the_page_and_nothing_else(
    open_one: Beside, path: str, changes: Mapping[str, str], status: int
) -> None:
    with open_one.client() as client:
        assert client.get(path, headers={**LINK, **changes}).status_code == status


def test_large_requests_are_refused(open_one: Beside) -> None:
    with open_one.client() as client:
        kind = {"content-type": "application/json"}
        assert client.post("/intents", content=b"x" * 5000, headers=kind).status_code == 413
        assert client.post("/intents", content=iter([b"x" * 10]), headers=kind).status_code == 413


@pytest.mark.parametrize("path", ["/", "/state", "/chart", "/events", "/files/page.js"])
def test_without_the_token_nothing_is_shown(guarded: Beside, path: str) -> None:
    with guarded.client() as client:
        for answer in (
            client.get(path),
            client.get(path, headers={"authorization": "Bearer wrong"}),
            client.get(path, headers={"cookie": f"{cookie_name_for(TOKEN)}=wrong"}),
            client.get(f"{path}?token=wrong"),
        ):
            assert answer.status_code == 401
            assert "a token is needed" in answer.text


def test_without_the_token_nothing_is_ordered(guarded: Beside) -> None:
    with guarded.client() as client:
        assert client.post("/intents", json=HOLD).status_code == 401
        assert client.post(f"/intents?token={TOKEN}", json=HOLD).status_code == 401
    assert guarded.asked == []


def test_the_token_is_shown_once_and_kept_by_the_browser(guarded: Beside) -> None:
    with guarded.client() as client:
        admitted = client.get("/", params={"token": TOKEN})
        assert (admitted.status_code, admitted.headers["location"]) == (303, "/")
        cookie = admitted.headers["set-cookie"].lower()
        assert "httponly" in cookie
        assert "samesite=strict" in cookie
        assert client.get("/state").status_code == 200
    with guarded.client(authorization=f"Bearer {TOKEN}") as client:
        assert client.get("/state").status_code == 200


def test_a_port_that_is_taken_is_named(open_one: Beside) -> None:
    taken = Beside(port=open_one.port).server
    with pytest.raises(ConnectionFailed, match=f"web: cannot listen on 127.0.0.1 port {open_one.port}"), taken:
        pass


def test_a_flight_that_does_not_decide_is_reported() -> None:
    beside = Beside(decides=False)
    with beside.server, beside.client() as client:
        answer = client.post("/intents", json=HOLD)
    assert (answer.status_code, answer.text) == (503, "the flight does not answer")


def test_garbage_on_the_wire_does_no_harm(open_one: Beside) -> None:
    for garbage in (
        b"\x00" * 3000,
        b"GET / HTTP/9\r\n\r\n",
        b"POST /intents HTTP/1.1\r\nContent-Length: 9999999\r\n\r\n",
        b"G",
    ):
        with socket.create_connection(("127.0.0.1", open_one.port), timeout=PATIENCE_S) as one:
            one.sendall(garbage)
    with open_one.client() as client:
        assert client.get("/state").status_code == 200


@pytest.mark.asyncio
@pytest.mark.looptime
async def test_a_slow_browser_gets_the_newest_state_and_is_then_disconnected() -> None:
    newest, taken = LatestValue(), list[bytes]()
    stuck = asyncio.Event()

    async def send(message: Mapping[str, object]) -> None:
        body = message.get("body", b"")
        assert isinstance(body, bytes)
        if body.startswith(b"data: "):
            taken.append(body)
            await asyncio.sleep(4.8 if len(taken) < 3 else 60.0)

    async def receive() -> dict[str, object]:
        await stuck.wait()
        return {"type": "http.disconnect"}

    following = asyncio.create_task(EventStream(newest)({"type": "http"}, receive, send))
    for number in range(100):
        await newest.put(str(number).encode())
        await asyncio.sleep(0.5)
    await following
    assert [int(body[6:]) for body in taken] == [0, 9, 19]
    assert newest.streams == {}


def test_the_last_state_is_read_while_the_flight_continues() -> None:
    """Reading goes on in another thread: the flight's own work never waits for it."""
    with serving() as beside, beside.client() as client:
        until_s = time.monotonic() + 1.0
        while time.monotonic() < until_s:
            beside.flight.pass_s(0.4)
        assert client.get("/state").json()["now_s"] == pytest.approx(beside.flight.now_s, abs=0.01)


def test_two_flights_on_one_computer_in_one_browser() -> None:
    """Cookies are kept by host, whatever the port."""
    other = f"{TOKEN}-2"
    with serving(TOKEN) as first, serving(other) as second, httpx.Client() as browser:
        for beside, token in ((first, TOKEN), (second, other)):
            assert browser.get(beside.server.address, params={"token": token}).status_code == 303
        for beside in (first, second):
            assert browser.get(f"{beside.server.address}state").status_code == 200


def test_other_programs_cookies_on_this_computer_do_not_matter(guarded: Beside) -> None:
    with guarded.client(cookie=f'a={{"b":1}}; =; c; {cookie_name_for(TOKEN)}={TOKEN}; d="') as client:
        assert client.get("/state").status_code == 200


def test_a_stream_that_dies_is_begun_again_and_no_trace_is_shown(capfd: pytest.CaptureFixture[str]) -> None:
    looks = iter(range(1, 100))

    def mistaken(*what: Any) -> FleetView:
        if next(looks) in {2, 4}:
            raise ZeroDivisionError("a mistake")
        return build_fleet_view(*what)

    beside = Beside(describe=mistaken)
    with beside.server, beside.client() as client, client.stream("GET", "/events") as stream:
        lines = (line for line in stream.iter_lines() if line.startswith("data: "))
        assert [json.loads(next(lines)[6:])["segments_total"] for _ in range(3)] == [6, 6, 6]
    assert beside.mistakes == ["the page's stream: ZeroDivisionError: a mistake"] * 2
    assert capfd.readouterr().err == ""


def test_a_request_that_dies_is_reported_and_no_trace_is_shown(capfd: pytest.CaptureFixture[str]) -> None:
    class Wrong(Exception):
        pass

    def mistaken(*_: object) -> FleetView:
        raise Wrong

    beside = Beside(describe=mistaken)
    with beside.server:
        with beside.client() as client:
            assert client.get("/state").status_code == 500
        with beside.client() as client:  # the connection of the first one is closed, at a moment of its own
            assert client.get("/").status_code == 200
    assert "a request to the page: Wrong: " in beside.mistakes
    assert capfd.readouterr().err == ""


def test_a_server_that_dies_listens_again_at_the_same_place(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, tries = uvicorn.Server.serve, iter(range(10))

    async def mistaken(server: uvicorn.Server, sockets: list[socket.socket] | None = None) -> None:
        if next(tries) < 2:
            raise RuntimeError("no more memory")
        await whole(server, sockets)

    monkeypatch.setattr(uvicorn.Server, "serve", mistaken)
    beside = Beside()
    with beside.server, beside.client() as client:
        assert client.get("/state").status_code == 200
    assert beside.mistakes == ["the page: RuntimeError: no more memory"] * 2
