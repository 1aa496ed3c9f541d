"""Whole flights at real brokers that die, sleep and dawdle: the flight ends as it would without one."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import aiomqtt
import pytest

from executor.replay.run_replay import replay_run
from tests.brokers import KIND, running
from tests.e2e.flights import called, ended, log_lines, notes, said_in, site_file
from tests.patience import PATIENCE_S

pytestmark = pytest.mark.asyncio

SPEEDUP = 10.0
PYLONS = 8


@dataclass(slots=True)
class Ear:
    """Everything that a broker passed on, by topic."""

    heard: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    _news: asyncio.Event = field(default_factory=asyncio.Event)

    def take(self, message: aiomqtt.Message) -> None:
        assert isinstance(message.payload, bytes)
        self.heard.setdefault(str(message.topic), []).append(json.loads(message.payload))
        self._news.set()

    async def lost(self, name: str) -> None:
        """Return when a vehicle is known to be lost."""
        async with asyncio.timeout(PATIENCE_S):
            while not any(one["vehicle"]["fault"] for one in self.heard.get(f"crew/v1/vehicle/{name}/state", ())):
                self._news.clear()
                await self._news.wait()

    async def more(self, topic: str, count: int) -> None:
        """Return when so many more messages have come."""
        wanted = len(self.heard.get(f"crew/v1/{topic}", ())) + count
        async with asyncio.timeout(PATIENCE_S):
            while len(self.heard.get(f"crew/v1/{topic}", ())) < wanted:
                self._news.clear()
                await self._news.wait()

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
    assert not any("internal error" in note["said"] for note in notes(run))
    again = replay_run(run)
    assert (again.comparison.first_difference, again.comparison.reworded) == ("", "")
    return report


def wish(name: str, action: str, **more: object) -> str:
    stamp = datetime.now(UTC).isoformat()
    return json.dumps({"timestamp": stamp, "id": name, "action": action, "vehicle": "uav1", "token": "s3cret", **more})


async def test_a_flight_is_steered_and_its_broker_is_stopped_started_and_suspended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CREW_TOKEN", "s3cret")
    run = tmp_path / "run"
    async with running(KIND, tmp_path / "broker") as broker:
        site = site_at(tmp_path, broker.port, telemetry_rate_hz=5.0, token_env="CREW_TOKEN")  # noqa: S106
        plan = tmp_path / "plan.json"
        async with called("plan", str(site), "--all-vehicles", "--seconds", "0.2", "-o", str(plan)) as planning:
            await ended(planning)
        fly = ["fly", str(site), "--plan", str(plan), "--yes", "--run", str(run)]
        async with called("simulate", str(site), "--fault", "uav2:silent@40%"), called(*fly) as flight:
            await said_in(flight.stderr, "mqtt: connected to", "uav1: flies its mission")
            async with listening(broker.port) as ear, aiomqtt.Client("127.0.0.1", broker.port) as crew:
                assert (await ear.until("fleet/connection"))["connectionState"] == "ONLINE"
                held = await accepted(crew, ear)
                await ear.until("intent/ack", id=held, outcome="done")
                await crew.publish("crew/v1/intent", wish("t1", "resume", token="guess"), qos=1)  # noqa: S106
                assert (await ear.until("intent/ack", id="t1", outcome="refused"))["text"].startswith("token: ")
                for _ in range(2):
                    await crew.publish("crew/v1/intent", wish("r1", "resume"), qos=1)
                await ear.until("intent/ack", id="r1", outcome="done")
            await broker.stop()
            await said_in(flight.stderr, "mqtt: lost the connection")
            await broker.start()
            await said_in(flight.stderr, "mqtt: connected to")
            async with listening(broker.port) as ear:
                # This broker knows nothing of what the one before it was told.
                assert (await ear.until("fleet/plan"))["plan"]["format"] == "faultline-plan/2"
                assert (await ear.until("fleet/connection"))["connectionState"] == "ONLINE"
                await ear.lost("uav2")
            broker.suspend()
            await ended(flight)
        broker.go_on()
        async with listening(broker.port) as ear:
            await ear.until("fleet/connection", connectionState="CONNECTIONBROKEN")
    report = flown_as_ever(run, flight.returncode)
    assert len(report["faults"]) == 1
    told = [line["told"] for line in log_lines(run) if "told" in line]
    assert any(line.startswith("mqtt: lost the connection to") for line in told)
    assert told[-1].endswith(f"messages never reached 127.0.0.1:{broker.port}")
    assert "s3cret" not in (run / "site.toml").read_text(encoding="utf-8")
    assert "s3cret" not in (run / "events.jsonl").read_text(encoding="utf-8")


async def accepted(crew: aiomqtt.Client, ear: Ear) -> str:
    """Ask a vehicle to hold; it is refused as long as it climbs, and so is who asks more than five times a second."""
    for number in range(100):
        await ear.more("vehicle/uav1/telemetry", 2)
        name = f"h{number}"
        await crew.publish("crew/v1/intent", wish(name, "hold"), qos=1)
        if (await ear.until("intent/ack", id=name))["outcome"] == "accepted":
            return name
    raise AssertionError("it never held")
