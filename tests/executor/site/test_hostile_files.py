"""Whatever lies in a file, and wherever one is to be written: one line and exit 2, never a traceback or exit 70."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from executor.cli.main import main
from tests.executor.cli.test_main import Place, place
from tests.executor.flight.test_resume_flight import launched, prepared

__all__ = ["place"]

BOM = b"\xef\xbb\xbf"
SPOILT: dict[str, bytes | None] = {
    "a directory": None,
    "nothing": b"",
    "a byte order mark": BOM,
    "binary": bytes(range(256)) * 9,
    "UTF-16": '{"a": 1}'.encode("utf-16"),
    "zeros": bytes(100),
    "lists in lists": b"[" * 100_000,
    "objects in objects": b'{"a":' * 100_000,
    "TOML in TOML": b"a = " + b"[" * 5000 + b"]" * 5000,
    "a number of JSON without end": b'{"format":' + b"9" * 5000 + b"}",
    "a number of TOML without end": b"a = " + b"9" * 5000,
    "NaN": b'{"format": NaN}',
    "a time beyond all": b'{"format":"faultline-events/1","began_unix_s":1' + b"0" * 400 + b',"speedup":1}\n',
    "null": b"null",
    "a text": b'"plan"',
}
READERS: dict[str, list[str]] = {
    "plan": ["plan", "FILE"],
    "plan --after": ["plan", "site.toml", "--after", "FILE"],
    "check": ["check", "FILE"],
    "window": ["window", "FILE"],
    "risk": ["risk", "FILE", "--mtbf", "5"],
    "replan": ["replan", "FILE", "--lost", "uav1", "--at", "5"],
    "export": ["export", "FILE", "-o", "out"],
    "init": ["init", "FILE"],
    "simulate": ["simulate", "FILE"],
    "preflight": ["preflight", "FILE"],
    "preflight --plan": ["preflight", "site.toml", "--plan", "FILE"],
    "fly": ["fly", "FILE"],
    "fly --plan": ["fly", "site.toml", "--plan", "FILE"],
    "resume": ["resume", "FILE"],
    "replay": ["replay", "FILE"],
    "replay --site": ["replay", "plan.json", "--site", "FILE"],
    "demo --network": ["demo", "--network", "FILE", "--run", "run"],
    "bench --instance": ["bench", "solvers", "--instance", "FILE"],
}


@pytest.fixture(scope="module")
def planned_once() -> list[bytes]:
    """The plan of the place, once somebody has made it: it is the same in every one."""
    return []


@pytest.fixture
def here(place: Place, planned_once: list[bytes], monkeypatch: pytest.MonkeyPatch) -> Place:
    """A place to work in, with a site and a plan."""
    if not planned_once:
        planned_once.append(Path(place.planned()).read_bytes())
    Path(place.path("plan.json")).write_bytes(planned_once[0])
    monkeypatch.chdir(place.folder)
    return place


@pytest.mark.parametrize("content", SPOILT.values(), ids=SPOILT)
@pytest.mark.parametrize("command", READERS.values(), ids=READERS)
def test_a_file_that_is_none(here: Place, command: list[str], content: bytes | None) -> None:
    if content is None:
        Path("spoilt").mkdir()
    else:
        Path("spoilt").write_bytes(content)
    reason = here.refused(*("spoilt" if word == "FILE" else word for word in command))
    assert "spoilt" in reason
    assert len(reason) < 1000


def test_a_byte_order_mark_is_read(here: Place) -> None:
    for name in ("site.toml", "line.geojson", "plan.json"):
        path = Path(name)
        path.write_bytes(BOM + path.read_bytes())
    Path("line.graph").write_bytes(BOM + b'pylons_position = "0 0 0; 100 0 0;"\nconnections_indexes = "2; 1;"\n')
    assert here.run("plan", "site.toml", "--seconds", "0.2")[0] == 0
    assert here.run("check", "plan.json")[0] == 0
    assert here.run("init", "line.graph", "--depot", "49.6,15.6,450")[0] == 0


WRITERS: dict[str, list[str]] = {
    "plan": ["plan", "site.toml", "--seconds", "0.1", "--json", "-o", "PLACE"],
    "plan --picture": ["plan", "site.toml", "--seconds", "0.1", "--json", "--picture", "PLACE"],
    "window": ["window", "plan.json", "--picture", "PLACE"],
    "risk": ["risk", "plan.json", "--mtbf", "5", "--json", "--picture", "PLACE"],
    "replan": ["replan", "plan.json", "--lost", "uav1", "--at", "5", "-o", "PLACE"],
    "init": ["init", "default", "-o", "PLACE"],
    "simulate": ["simulate", "site.toml", "--truth", "PLACE"],
}
FOLDERS: dict[str, list[str]] = {
    "plan --front": ["plan", "site.toml", "--front", "--seconds", "0.5", "--json", "-o", "PLACE"],
    "export": ["export", "plan.json", "-o", "PLACE"],
    "fly": ["fly", "site.toml", "--plan", "plan.json", "--json", "--run", "PLACE"],
}


@pytest.mark.parametrize("target", [".", "nowhere/there", "site.toml/there", "/proc/there", "x" * 300])
@pytest.mark.parametrize("command", WRITERS.values(), ids=WRITERS)
def test_a_place_for_no_file(here: Place, command: list[str], target: str) -> None:
    assert target[:50] in here.refused(*(target if word == "PLACE" else word for word in command))
    assert sorted(path.name for path in Path().iterdir()) == ["line.geojson", "plan.json", "site.toml"]


@pytest.mark.parametrize("target", ["site.toml", "site.toml/there", "/proc/there", "x" * 300])
@pytest.mark.parametrize("command", FOLDERS.values(), ids=FOLDERS)
def test_a_place_for_no_directory(here: Place, command: list[str], target: str) -> None:
    assert target[:50] in here.refused(*(target if word == "PLACE" else word for word in command))


@pytest.mark.parametrize(
    ("command", "option"),
    [
        (["plan", "site.toml"], "--seconds"),
        (["plan", "site.toml"], "--stretch"),
        (["plan", "site.toml"], "--seed"),
        (["replan", "plan.json", "--lost", "uav1"], "--at"),
        (["risk", "plan.json"], "--mtbf"),
        (["risk", "plan.json", "--mtbf", "5"], "--samples"),
        (["demo"], "--radius"),
        (["simulate", "site.toml"], "--wind"),
        (["bench", "solvers"], "--radius"),
    ],
)
@pytest.mark.parametrize("value", ["nan", "inf", "9" * 30, "1e400"])
def test_a_number_that_is_none(here: Place, command: list[str], option: str, value: str) -> None:
    if option in {"--mtbf", "--radius"} and value == "9" * 30:
        pytest.skip("a large one, but one")
    assert option in here.refused(*command, option, value)


FEW = settings(
    max_examples=60, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture], deadline=None
)
ODD: st.SearchStrategy[object] = st.one_of(
    st.none(),
    st.booleans(),
    st.sampled_from([-1, 0, 10**30, 10**400, 2**53, -1.5, 1e12, 1e308, 5e-324]),
    st.sampled_from(["", "a\nb", "\x00", "\ud800", "../../x", "x" * 500]),
    st.sampled_from([[], {}, [[]], [None], {"a": 1}]),
)


def places(value: Any, path: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """Return the paths of everything in a JSON document, of lists their first two entries."""
    inner = value.items() if isinstance(value, dict) else enumerate(value[:2]) if isinstance(value, list) else ()
    return [path, *(one for key, item in inner for one in places(item, (*path, key)))]


def changed(document: Any, path: tuple[str | int, ...], value: object) -> Any:
    if not path:
        return value
    copy = deepcopy(document)
    at = copy
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    return copy


def ends_well(capsys: pytest.CaptureFixture[str], *arguments: str) -> None:
    """Run the command line: done, no, or one line."""
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    said = capsys.readouterr()
    assert ended.value.code in {0, 1, 2}, said.err
    if ended.value.code == 2:
        assert said.err.count("\n") == 1, said.err
        assert said.err.startswith("faultline: ")


JSON_READERS: dict[str, tuple[str, Callable[[Place], list[list[str]]]]] = {
    "a plan": (
        "plan.json",
        lambda _: [
            ["check", "plan.json"],
            ["preflight", "site.toml", "--plan", "plan.json", "--json"],
            ["export", "plan.json", "-o", "out"],
        ],
    ),
    "a network": ("line.geojson", lambda _: [["simulate", "site.toml", "--fault", "nobody:crash@1s"]]),
}


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", JSON_READERS)
def test_json_with_one_odd_value(here: Place, capsys: pytest.CaptureFixture[str], name: str) -> None:
    file, calls = JSON_READERS[name]
    here.site(extra="[flight]\nconnect_timeout_s = 0.01")
    document = json.loads(Path(file).read_text())

    @FEW
    @given(st.sampled_from(places(document)), ODD)
    def odd(path: tuple[str | int, ...], value: object) -> None:
        Path(file).write_text(json.dumps(changed(document, path, value)))
        for call in calls(here):
            ends_well(capsys, *call)

    odd()


@pytest.mark.parametrize("file", ["site.toml", "line.geojson", "plan.json"])
def test_spoilt_bytes(here: Place, capsys: pytest.CaptureFixture[str], file: str) -> None:
    good = Path(file).read_bytes()

    @FEW
    @given(st.integers(0, len(good)), st.integers(0, 20), st.binary(max_size=8))
    def spoilt(at: int, gone: int, new: bytes) -> None:
        Path(file).write_bytes(good[:at] + new + good[at + gone :])
        ends_well(capsys, "simulate", "site.toml", "--fault", "nobody:crash@1s")
        ends_well(capsys, "check", "plan.json")

    spoilt()


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run directory of a flight that was left in its midst."""
    run = prepared(tmp_path_factory.mktemp("flown"))
    flight, diary = launched(run)
    flight.run(lambda: len(flight.state.coverage.inspected) == 2)
    diary.note()
    diary.log.close()
    return run


def test_a_run_directory_that_is_whole(flown: Path, here: Place) -> None:
    shutil.copytree(flown, "run")
    assert here.run("replay", "run")[0] == 0
    assert here.refused("resume", "run", "--json").startswith("not confirmed")


RUN_FILES = ("site.toml", "network.yaml", "plan-000.json", "vehicles.json", "events.jsonl")


@pytest.mark.parametrize("file", RUN_FILES)
@pytest.mark.parametrize("content", [*SPOILT.values(), b"gone"], ids=[*SPOILT, "gone"])
def test_a_run_directory_with_a_spoilt_file(flown: Path, here: Place, file: str, content: bytes | None) -> None:
    run = Path("run")
    shutil.copytree(flown, run)
    (run / file).unlink()
    if content is None:
        (run / file).mkdir()
    elif content != b"gone":
        (run / file).write_bytes(content)
    assert "run" in here.refused("replay", "run", "--json")
    if file == "events.jsonl" and content in {b"", b"gone"}:
        return  # nothing was launched: the flight would begin from its beginning
    here.refused("resume", "run", "--json")


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_an_event_log_with_an_odd_value(flown: Path, here: Place, capsys: pytest.CaptureFixture[str]) -> None:
    run = Path("run")
    shutil.copytree(flown, run)
    lines = (run / "events.jsonl").read_text().splitlines()
    # One line of each kind: thousands are alike.
    kinds = {re.sub(r"[-0-9.e]+", "", line): number for number, line in enumerate(lines)}

    @settings(FEW, max_examples=25)
    @given(st.sampled_from(sorted(kinds.values())), st.data())
    def odd(number: int, data: st.DataObject) -> None:
        document = json.loads(lines[number])
        path, value = data.draw(st.sampled_from(places(document))), data.draw(ODD)
        spoilt = [*lines[:number], json.dumps(changed(document, path, value)), *lines[number + 1 :]]
        (run / "events.jsonl").write_text("\n".join(spoilt) + "\n")
        ends_well(capsys, "replay", "run", "--json")
        ends_well(capsys, "resume", "run", "--json")

    odd()
