"""The end of a log, read without the rest."""

from __future__ import annotations

from pathlib import Path

import pytest

from executor.adapters import eventlog as logend
from executor.adapters.eventlog import EventLog, read_events, to_plain, total_clock_step_s
from executor.core.interface.commands import Finish
from executor.core.interface.events import Heard, Tick
from executor.core.interface.messages import StatusText


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A log of lines of many lengths, read in pieces that are shorter than most of them."""
    monkeypatch.setattr(logend, "PIECE_BYTES", 64)
    path = tmp_path / "events.jsonl"
    log = EventLog(path, began_unix_s=5.0, speedup=1.0)
    for number in range(40):
        log.write(Heard("uav1", StatusText(6, "x" * number)), float(number))
    log.note(40.0, said="y" * 300, level="info")
    log.close()
    return path


def test_the_last_event_is_found_behind_what_is_no_event_and_what_is_torn(path: Path) -> None:
    assert logend.read_last_event_s(path) == 39.0
    with path.open("ab") as file:
        file.write(
            b'{"t_s":70.0,"event":\n\xff\n{"t_s":NaN,"event":{"kind":"Tick"}}\n{"t_s":80.0,"event":{"kind":"Tick"}}'
        )
    assert logend.read_last_event_s(path) == 39.0
    with path.open("ab") as file:
        file.write(b"\n")
    assert logend.read_last_event_s(path) == 80.0


def test_a_log_without_events_has_no_last_one(tmp_path: Path) -> None:
    EventLog(tmp_path / "log", began_unix_s=5.0).close()
    assert logend.read_last_event_s(tmp_path / "log") is None
    (tmp_path / "log").write_bytes(b"")
    assert logend.read_last_event_s(tmp_path / "log") is None
    assert total_clock_step_s(tmp_path / "log") == 0.0


def test_a_place_is_known_again_and_nothing_else_is(path: Path) -> None:
    """After every line the log tells where it is; with that much of the file it holds, with a byte less it does not."""
    log = EventLog(path, lines=logend.count_lines_after(path, None))
    places = []
    for number in range(20):
        log.write(Tick(), 41.0 + number)
        places.append(log.current_place())
    log.close()
    assert places[-1] == log_end(path, 60.0)
    whole = path.read_bytes()
    for number, place in enumerate(places):
        assert place is not None
        assert logend.is_place_in_log(path, place)
        assert logend.count_lines_after(path, place) == 19 - number
        assert next((at_s for at_s, _ in read_events(path, None, place)), None) == (
            42.0 + number if number < 19 else None
        )
    for change in (whole.replace(b"5.0", b"6.0", 1), whole.replace(b'{"t_s":60.0', b'{"t_s":61.0'), whole[:-1], b""):
        path.write_bytes(change)
        assert not logend.is_place_in_log(path, log_place(places[-1]))
    path.unlink()
    assert not logend.is_place_in_log(path, log_place(places[-1]))


def log_place(place: logend.LogPlace | None) -> logend.LogPlace:
    assert place is not None
    return place


def log_end(path: Path, at_s: float) -> logend.LogPlace:
    """The end of a whole log, reckoned from all of it."""
    lines = path.read_bytes().splitlines(keepends=True)
    return logend.LogPlace(path.stat().st_size, len(lines), at_s, logend.digest_of(lines[0], lines[-1]))


def test_a_log_that_continues_tells_the_same_places(path: Path) -> None:
    with path.open("ab") as file:
        file.write(b'{"t_s":41')
    log = EventLog(path, lines=logend.count_lines_after(path, None))
    log.write(Tick(), 42.0)
    place = log.current_place()
    log.close()
    assert place == log_end(path, 42.0)


def test_the_end_of_a_flight_is_seen_at_its_end_alone(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logend, "PIECE_BYTES", 500)
    assert not logend.is_flight_finished(path)
    log = EventLog(path)
    log.note(50.0, command=to_plain(Finish("all segments inspected")))
    assert logend.is_flight_finished(path)
    for number in range(20):
        log.write(Tick(), 51.0 + number)
    log.close()
    assert not logend.is_flight_finished(path)


def test_clocks_that_were_set_are_found_from_a_place_on(path: Path) -> None:
    log = EventLog(path, lines=logend.count_lines_after(path, None))
    log.note(50.0, clock_set_s=-3600.0)
    log.write(Tick(), 51.0)
    place = log.current_place()
    log.note(52.0, clock_set_s=60.0)
    log.write(Heard("uav1", StatusText(6, '"clock_set_s":7')), 53.0)
    log.close()
    assert total_clock_step_s(path) == -3540.0
    assert total_clock_step_s(path, place) == 60.0
