"""The services of the profile `demo` as processes, with their own commands; only names and paths are changed."""

from __future__ import annotations

import asyncio
import json
import os
import sys
from pathlib import Path
from typing import Any

import aiomqtt
import pytest

from tests.brokers import KIND, running
from tests.composed import ROOT, services
from tests.e2e.flights import ended, interrupt
from tests.patience import PATIENCE_S
from tests.ports import free_ports, is_free

ASKED = {"FAULTLINE_VEHICLES": "3", "FAULTLINE_SPEEDUP": "12", "FAULTLINE_FAULT": "uav2:battery-step=30@40%"}


class Services:
    """Starts services where they are."""

    def __init__(self, folder: Path, broker_port: int) -> None:
        self.site, self.work = folder / "site", folder / "work"
        self.site.mkdir()
        self.work.mkdir()
        self.port = _row_of_ports(3)
        pattern = (ROOT / "docker" / "demo.toml").read_text(encoding="utf-8")
        here = pattern.replace("127.0.0.1:14600", f"127.0.0.1:{self.port}").replace("radius_m = 700", "radius_m = 250")
        assert here.count(str(self.port)) == 1
        assert "port = 8080" in here
        here = here.replace("port = 8080", "port = 0").replace('host = "0.0.0.0"', 'host = "127.0.0.1"')
        assert 'host = "broker"' in here
        here = here.replace('host = "broker"', f'host = "127.0.0.1"\nport = {broker_port}')
        self.pattern = folder / "demo.toml"
        self.pattern.write_text(here, encoding="utf-8")
        self.services = services("demo", ASKED)

    def argv(self, service: dict[str, Any], words: list[str] | None = None) -> list[str]:
        if words is None:
            words = [*service.get("entrypoint", ["faultline"]), *service["command"]]
        places = {
            "/opt/faultline/docker/demo.toml": str(self.pattern),
            "/opt/faultline/docker": str(ROOT / "docker"),
            "/site": str(self.site),
            "/runs": str(self.work / "runs"),
            "14600": str(self.port),
        }
        given = []
        for word in words:
            for there, here in places.items():
                if word.startswith(there):
                    word = here + word.removeprefix(there)
                    break
            given.append(word)
        programs = {"faultline": [sys.executable, "-m", "executor"], "python": [sys.executable]}
        return [*programs[given[0]], *given[1:]]

    async def start(self, name: str) -> asyncio.subprocess.Process:
        service, pipe = self.services[name], asyncio.subprocess.PIPE
        environment = {**os.environ, "PYTHONPATH": str(ROOT), **service.get("environment", {})}
        return await asyncio.create_subprocess_exec(
            *self.argv(service), cwd=self.work, env=environment, stdin=asyncio.subprocess.DEVNULL, stdout=pipe,
            stderr=pipe,
        )  # fmt: skip

    async def healthy(self, name: str) -> bool:
        service = self.services[name]
        test = service["healthcheck"]["test"]
        assert test[0] == "CMD"
        process = await asyncio.create_subprocess_exec(*self.argv(service, test[1:]))
        return await process.wait() == 0


def _row_of_ports(count: int) -> int:
    """Return the first of as many neighbouring ports that nobody uses at the moment."""
    for _ in range(100):
        [first] = free_ports(1)
        if all(is_free(first + more) for more in range(count)):
            return first
    raise AssertionError("no free ports")


@pytest.mark.asyncio
async def test_the_demo_of_the_containers_flies_to_its_end(tmp_path: Path) -> None:
    async with running(KIND, tmp_path / "broker") as broker:
        await _flies_to_its_end(Services(tmp_path, broker.port))
        async with aiomqtt.Client("127.0.0.1", broker.port) as anybody:
            await anybody.subscribe("faultline/v1/fleet/state", qos=1)
            message = await anext(aiter(anybody.messages))
    assert isinstance(message.payload, bytes)
    assert json.loads(message.payload)["finished"]


async def _flies_to_its_end(here: Services) -> None:
    prepared = await here.start("site-demo")
    _, err = await ended(prepared)
    assert prepared.returncode == 0, err
    assert not await here.healthy("fleet")
    fleet = await here.start("fleet")
    try:
        async with asyncio.timeout(PATIENCE_S):
            while not await here.healthy("fleet"):
                assert fleet.returncode is None, (await ended(fleet))[1]
        executor = await here.start("executor-demo")
        try:
            _, err = await ended(executor)
        finally:
            if executor.returncode is None:
                executor.kill()
                await executor.wait()
        assert executor.returncode == 0, err
        assert await here.healthy("executor-demo")
    finally:
        if fleet.returncode is None:
            interrupt(fleet)
            await ended(fleet)
    [run] = (here.work / "runs").iterdir()
    report = json.loads((run / "report.json").read_text(encoding="utf-8"))
    assert report["finished"]
    assert ("uav2", "battery") in [(fault["vehicle"], fault["kind"]) for fault in report["faults"]]
    assert len(report["vehicles"]) == 3
    assert {row["firmware"] for row in report["vehicles"]} == {"4.7.0-dev"}
