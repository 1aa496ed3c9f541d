"""Connection limits of the page's server: no client can lock the crew out."""

from __future__ import annotations

import select
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import pytest

from executor.adapters.web import guard
from executor.adapters.web.guard import HERE, ConnectionLimits, ConnectionQuota, origin_of
from tests.executor.adapters.web.test_server import TOKEN, Beside
from tests.patience import PATIENCE_S

QUICK = ConnectionLimits(request_s=0.4, answer_s=0.4)
ABROAD = "127.0.0.9"
"""A second address of this computer, which stands for another computer."""


@pytest.fixture
def abroad(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take all addresses but 127.0.0.1 for those of other computers."""

    def origin(peer: str, _: str) -> str:
        return HERE if peer == "127.0.0.1" else peer

    monkeypatch.setattr(guard, "origin_of", origin)
    monkeypatch.setattr(guard, "origin_of", origin)


@contextmanager
def listening(limits: ConnectionLimits | None = None, token: str | None = None) -> Iterator[Beside]:
    beside = Beside(token, limits=limits)
    with beside.server:
        yield beside
    assert beside.mistakes == []


def connected(stack: ExitStack, beside: Beside, source: str = "127.0.0.1", said: bytes = b"") -> socket.socket:
    one = stack.enter_context(socket.create_connection(("127.0.0.1", beside.port), PATIENCE_S, (source, 0)))
    one.sendall(said)
    return one


def ended(one: socket.socket) -> bytes:
    """Wait until the server has hung up; returns what it said."""
    said = b""
    try:
        while part := one.recv(1 << 16):
            said += part
    except ConnectionError:
        pass
    return said


def hung_up(one: socket.socket) -> bool:
    """Return whether the server has hung up by now, without reading anything."""
    poll = select.poll()
    poll.register(one, select.POLLRDHUP)
    return bool(poll.poll(0))


def works_for_the_crew(beside: Beside) -> None:
    with beside.client(authorization=f"Bearer {TOKEN}") as client:
        assert client.get("/").status_code == 200
        assert client.get("/files/page.js").status_code == 200
        with client.stream("GET", "/events") as events:
            lines = (line for line in events.iter_lines() if line.startswith("data: "))
            assert next(lines)
            assert next(lines)
        assert client.post("/intents", json={"id": "w", "action": "hold", "vehicle": "uav2"}).status_code == 202


def test_200_silent_connections_from_this_computer_do_not_keep_the_crew_out() -> None:
    with listening(token=TOKEN) as beside, ExitStack() as stack:
        silent = [connected(stack, beside, said=b"GET / HTT" * (number % 2)) for number in range(200)]
        works_for_the_crew(beside)
        assert not hung_up(silent[-1]), "the newest ones are still there: the crew got in beside them"


@pytest.mark.usefixtures("abroad")
def test_connections_from_elsewhere_never_use_up_the_places_of_this_computer() -> None:
    events = f"GET /events HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {TOKEN}\r\n\r\n".encode()
    with listening(token=TOKEN) as beside, ExitStack() as stack:
        for number in range(200):
            connected(stack, beside, f"127.0.1.{number % 20 + 1}", events if number % 3 else b"")
        works_for_the_crew(beside)


@pytest.mark.usefixtures("abroad")
def test_of_one_address_those_make_room_that_were_silent_longest() -> None:
    places = ConnectionQuota(here=64, elsewhere=96, address=4)
    with listening(ConnectionLimits(connections=places, request_s=PATIENCE_S)) as beside, ExitStack() as stack:
        silent = [connected(stack, beside, ABROAD) for _ in range(6)]
        assert [ended(one) for one in silent[:2]] == [b"", b""]
        asks = connected(stack, beside, ABROAD, b"GET /clock HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
        assert b"200 OK" in ended(asks)
        assert ended(silent[2]) == b""
        assert not any(hung_up(one) for one in silent[3:])


@pytest.mark.usefixtures("abroad")
def test_with_all_connections_busy_a_new_one_is_refused() -> None:
    looks = b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n"
    with (
        listening(ConnectionLimits(connections=ConnectionQuota(here=64, elsewhere=2, address=2))) as beside,
        ExitStack() as stack,
    ):
        for _ in range(2):
            assert b"data: " in _until(connected(stack, beside, ABROAD, looks), b"data: ")
        assert b"503 Service Unavailable" in ended(connected(stack, beside, ABROAD))
        works_for_the_crew(beside)


def _until(one: socket.socket, words: bytes) -> bytes:
    seen = b""
    while words not in seen:
        part = one.recv(1 << 16)
        assert part, seen
        seen += part
    return seen


POST = b"POST /intents HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: 60\r\n\r\n"
WHOLE = b"GET /clock HTTP/1.1\r\nHost: localhost\r\n\r\n"


@pytest.mark.parametrize(
    "said", [b"", b"G", b"GET / HTTP/1.1\r\nHost: loc", POST, POST + b'{"id":', WHOLE, WHOLE + WHOLE[:20]],
    ids=["nothing", "a letter", "half a head", "no body", "half a body", "no second request", "half a second request"],
)  # fmt: skip
def test_an_endless_request_is_cut_off(said: bytes) -> None:
    with listening(QUICK) as beside, ExitStack() as stack:
        answer = ended(connected(stack, beside, said=said))
    # Who asked for something may be answered first; a busy computer hangs up before it has come to that.
    assert b"200 OK" not in answer or said.startswith(WHOLE)


def test_a_letter_now_and_then_does_not_help() -> None:
    with listening(QUICK) as beside, ExitStack() as stack:
        one = connected(stack, beside)
        one.settimeout(0.05)
        sent = 0
        for letter in b"GET / HTTP/1.1\r\n" + b"x" * 1000:
            try:
                one.sendall(bytes([letter]))
                sent += 1
                if one.recv(1) == b"":
                    break
            except TimeoutError:
                continue
            except ConnectionError:
                break
        assert sent < 100


def test_a_client_that_reads_no_answer_is_cut_off() -> None:
    with listening(QUICK) as beside, ExitStack() as stack:
        one = connected(stack, beside, said=b"GET /files/page.css HTTP/1.1\r\nHost: localhost\r\n\r\n" * 1000)
        poll = select.poll()
        poll.register(one, select.POLLRDHUP)
        assert poll.poll(1000 * PATIENCE_S)


def test_a_stream_too_many_takes_the_place_of_the_one_that_has_looked_longest() -> None:
    looks = b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n"
    with (
        listening(ConnectionLimits(streams=ConnectionQuota(here=3, elsewhere=3, address=3))) as beside,
        ExitStack() as stack,
    ):
        followers = list[socket.socket]()
        for _ in range(5):
            followers.append(connected(stack, beside, said=looks))
            _until(followers[-1], b"data: ")
        for one in followers[:2]:
            ended(one)
        for one in followers[2:]:
            _until(one, b"data: ")


def test_nonsense_behind_an_answer_is_no_mistake_of_ours() -> None:
    """There is no way to say so any more: the answer was that no such body is taken."""
    with listening() as beside, ExitStack() as stack:
        one = connected(stack, beside, said=POST.replace(b"Content-Length: 60", b"Transfer-Encoding: chunked"))
        _until(one, b"expected at most 4096 bytes of a known length")
        one.sendall(b"no chunk\r\n\r\n" * 3)
        ended(one)
        works_for_the_crew(beside)


@pytest.mark.parametrize(
    ("peer", "own", "origin"),
    [
        ("127.0.0.1", "127.0.0.1", HERE),
        ("::1", "::1", HERE),
        ("::ffff:127.0.0.1", "::ffff:127.0.0.1", HERE),
        ("192.168.1.5", "192.168.1.5", HERE),  # the page's address as the terminal shows it
        ("192.168.1.6", "192.168.1.5", "192.168.1.6"),
        ("::ffff:192.168.1.6", "::ffff:192.168.1.5", "192.168.1.6"),
        ("2001:db8::abcd", "2001:db8::1", "2001:db8::/64"),
        ("fe80::1%eth0", "fe80::2", "fe80::/64"),
        ("", "", ""),
    ],
)
def test_from_where_a_connection_comes(peer: str, own: str, origin: str) -> None:
    assert origin_of(peer, own) == origin
