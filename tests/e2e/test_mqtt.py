"""Whole flights at real brokers that die, sleep and dawdle: the flight ends as it would without one."""

from __future__ import annotations

import asyncio
import json
import subprocess
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import aiomqtt
import pytest

from executor.rerun import rerun
from tests.brokers import MOSQUITTO, running
from tests.e2e.flights import FAULTLINE, PATIENCE_S, called, ended, log_lines, notes, said_in, site_file

pytestmark = pytest.mark.asyncio

KIND = "amqtt" if MOSQUITTO is None else "mosquitto"
SPEEDUP = 10.0
PYLONS = 8


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Made once: the planner takes its time otherwise."""
    folder = tmp_path_factory.mktemp("plan")
    arguments = [
        "plan",
        str(site_at(folder, 1883)),
        "--all-vehicles",
        "--seconds",
        "0.2",
        "-o",
        str(folder / "plan.json"),
    ]
    subprocess.run([*FAULTLINE, *arguments], check=True, capture_output=True, timeout=PATIENCE_S)
    return folder / "plan.json"


@dataclass(slots=True)
class Ear:
    """Everything that a broker passed on, by topic."""

    heard: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    _news: asyncio.Event = field(default_factory=asyncio.Event)

    def take(self, message: aiomqtt.Message) -> None:
        assert isinstance(message.payload, bytes)
        self.heard.setdefault(str(message.topic), []).append(json.loads(message.payload))
        self._news.set()

    async def until(self, topic: str, **wanted: object) -> dict[str, Any]:
        """Return the first message on a topic with these values; fails when an intent has ended otherwise."""
        async with asyncio.timeout(PATIENCE_S):
            while True:
                for one in self.heard.get(f"crew/v1/{topic}", ()):
                    if all(one.get(key) == value for key, value in wanted.items()):
                        return one
                    assert "id" not in wanted or one["id"] != wanted["id"] or one["outcome"] == "accepted", one
                self._news.clear()
                await self._news.wait()


@asynccontextmanager
async def listening(port: int) -> AsyncIterator[Ear]:
    ear = Ear()

    async def listen(client: aiomqtt.Client) -> None:
        with suppress(aiomqtt.MqttError):
            async for message in client.messages:
                ear.take(message)

    async with aiomqtt.Client("127.0.0.1", port) as client:
        await client.subscribe("crew/v1/#", qos=1)
        task = asyncio.create_task(listen(client))
        try:
            yield ear
        finally:
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task


def site_at(folder: Path, port: int, **more: object) -> Path:
    site, _ = site_file(folder, pylons=PYLONS, vehicles=3, speedup=SPEEDUP)
    lines = [f"{key} = {json.dumps(value)}" for key, value in {"port": port, "prefix": "crew", **more}.items()]
    site.write_text(site.read_text(encoding="utf-8") + "\n".join(["[mqtt]", *lines, ""]), encoding="utf-8")
    return site


def flown_as_ever(run: Path, code: int | None) -> Mapping[str, Any]:
    """What a flight with this one loss comes to, whatever its broker does."""
    assert code == 0
    report: dict[str, Any] = json.loads((run / "report.json").read_text(encoding="utf-8"))
    assert report["finished"]
    assert report["segments_inspected"] == report["segments_total"] == PYLONS - 1
    assert ("uav2", "link") in [(fault["vehicle"], fault["kind"]) for fault in report["faults"]]
    assert all(replan["feasible"] for replan in report["replans"])
    assert not any("internal mistake" in note["said"] for note in notes(run))
    again = rerun(run)
    assert again.comparison.same, again.comparison.first_difference
    return report


async def test_a_broker_that_is_stopped_and_started_and_then_sleeps(plan: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    async with running(KIND, tmp_path / "broker") as broker:
        site = site_at(tmp_path, broker.port, telemetry_rate_hz=5.0)
        fly = ["fly", str(site), "--plan", str(plan), "--yes", "--run", str(run)]
        async with called("simulate", str(site), "--fault", "uav2:silent@40%"), called(*fly) as flight:
            await said_in(flight.stderr, "mqtt: connected to", "uav1: flies its mission")
            async with listening(broker.port) as ear:
                assert (await ear.until("fleet/connection"))["connectionState"] == "ONLINE"
                await ear.until("vehicle/uav1/telemetry", state="flying")
            await broker.stop()
            await said_in(flight.stderr, "mqtt: lost the connection")
            await broker.start()
            await said_in(flight.stderr, "mqtt: connected to")
            async with listening(broker.port) as ear:
                # This broker knows nothing of what the one before it was told.
                assert len((await ear.until("fleet/plan"))["plan"]["segments"]) == PYLONS - 1
                assert (await ear.until("fleet/connection"))["connectionState"] == "ONLINE"
                assert (await ear.until("fleet/fault"))["vehicle"] == "uav2"
            broker.suspend()
            await ended(flight)
        broker.go_on()
        async with listening(broker.port) as ear:
            await ear.until("fleet/connection", connectionState="CONNECTIONBROKEN")
    report = flown_as_ever(run, flight.returncode)
    assert len(report["faults"]) == 1
    told = [line["told"] for line in log_lines(run) if "told" in line]
    assert [line.split(" 127")[0] for line in told[:3]] == [
        "mqtt: connected to", "mqtt: lost the connection to", "mqtt: connected to",
    ]  # fmt: skip
    assert told[-1].endswith(f"messages never reached 127.0.0.1:{broker.port}")


@asynccontextmanager
async def slowed(port: int, bytes_per_s: float) -> AsyncIterator[int]:
    """A relay before a broker that lets so much through from who connects to it."""
    step_s = 0.05
    closing = set[asyncio.Task[None]]()

    async def pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, most: int, wait_s: float) -> None:
        with suppress(OSError):
            while data := await reader.read(most):
                writer.write(data)
                await writer.drain()
                await asyncio.sleep(wait_s)
        writer.close()

    async def connected(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there_reader, there_writer = await asyncio.open_connection("127.0.0.1", port)
        most = max(1, int(bytes_per_s * step_s))
        both = [pass_on(reader, there_writer, most, step_s), pass_on(there_reader, writer, 65536, 0.0)]
        task = asyncio.ensure_future(_all(both))
        closing.add(task)
        task.add_done_callback(closing.discard)

    server = await asyncio.start_server(connected, "127.0.0.1", 0, limit=1024)
    try:
        yield int(server.sockets[0].getsockname()[1])
    finally:
        server.close()
        for task in tuple(closing):
            task.cancel()
        await asyncio.gather(*closing, return_exceptions=True)


async def _all(work: list[Any]) -> None:
    await asyncio.gather(*work)


def now() -> str:
    return datetime.now(UTC).isoformat()


async def test_a_flight_steered_over_a_slow_line_with_a_token(
    plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two kilobytes a second, less than the states are worth: the newest win, and what is asked for is answered."""
    monkeypatch.setenv("CREW_TOKEN", "s3")
    run = tmp_path / "run"
    async with running(KIND, tmp_path / "broker") as broker, slowed(broker.port, 2000.0) as port:
        site = site_at(tmp_path, port, telemetry_rate_hz=10.0, token_env="CREW_TOKEN")  # noqa: S106
        fly = ["fly", str(site), "--plan", str(plan), "--yes", "--run", str(run)]
        simulate = ["simulate", str(site), "--fault", "uav2:silent@40%"]
        async with listening(broker.port) as ear, called(*simulate), called(*fly) as flight:
            await said_in(flight.stderr, "mqtt: connected to", "uav1: flies its mission")
            async with aiomqtt.Client("127.0.0.1", broker.port) as crew:

                async def ask(name: str, action: str, **more: object) -> None:
                    wish = {"timestamp": now(), "id": name, "action": action, "vehicle": "uav1", "token": "s3", **more}
                    await crew.publish("crew/v1/intent", json.dumps(wish), qos=1)

                # Refused as long as it climbs.
                for number in range(40):
                    held = f"h{number}"
                    await ask(held, "hold")
                    if (await ear.until("intent/ack", id=held))["outcome"] == "accepted":
                        break
                await ear.until("intent/ack", id=held, outcome="done")
                await ask("t1", "resume", token="guess")  # noqa: S106
                assert (await ear.until("intent/ack", id="t1", outcome="refused"))["text"].startswith("token: ")
                await ask("t2", "resume", timestamp="2026-01-01T00:00:00Z")
                assert (await ear.until("intent/ack", id="t2", outcome="refused"))["text"].startswith("timestamp: ")
                await ask("x1", "hold", vehicle="uav9")
                await ear.until("intent/ack", id="x1", outcome="refused")
                await ask(held, "hold")
                await ask("r1", "resume")
                await ear.until("intent/ack", id="r1", outcome="done")
                assert (await ear.until("fleet/fault"))["vehicle"] == "uav2"
                await ended(flight)
    flown_as_ever(run, flight.returncode)
    sent = ear.heard["crew/v1/vehicle/uav1/telemetry"]
    numbers = [one["headerId"] for one in sent]
    assert numbers == sorted(set(numbers))
    assert len(sent) < numbers[-1] / 2, "most of them were overtaken by newer ones"
    assert [one["outcome"] for one in ear.heard["crew/v1/intent/ack"] if one["id"] == held] == [
        "accepted",
        "done",
        "done",
    ]
    assert "s3" not in (run / "site.toml").read_text(encoding="utf-8")
    assert '"s3"' not in (run / "events.jsonl").read_text(encoding="utf-8")
