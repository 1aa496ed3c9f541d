"""Whole flights: the real command line, simulated vehicles in a process of their own, UDP between them."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.patience import PATIENCE_S
from tests.ports import free_ports

FAULTLINE = (sys.executable, "-m", "executor")


@dataclass(frozen=True, slots=True)
class Flown:
    """What a demo left."""

    run: Path
    code: int
    report: dict[str, Any]
    said: list[str]
    """The lines for the operator, from the event log."""

    def vehicle(self, name: str) -> dict[str, Any]:
        """What the report says of a vehicle."""
        return next(one for one in self.report["vehicles"] if one["name"] == name)


async def demo(
    run: Path, *faults: str, autopilot: str = "ardupilot", speedup: float = 30.0, patience_s: float = PATIENCE_S
) -> Flown:
    """Fly the demo over the nearest segments of the default network, and return what it left."""
    arguments = ["demo", "--json", "--radius", "400", "--speedup", f"{speedup:g}", "--run", str(run)]
    arguments += ["--autopilot", autopilot]
    for fault in faults:
        arguments += ["--fault", fault]
    async with called(*arguments) as process:
        out, err = await ended(process, patience_s)
    assert process.returncode in {0, 1}, err
    return Flown(run, process.returncode, json.loads(out), [note["said"] for note in notes(run)])


@asynccontextmanager
async def called(*arguments: str) -> AsyncIterator[asyncio.subprocess.Process]:
    """Call the command line; if it still runs in the end, Ctrl-C is pressed and its end waited for."""
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(
        *FAULTLINE, *arguments, stdout=pipe, stderr=pipe, stdin=asyncio.subprocess.DEVNULL
    )
    try:
        yield process
    finally:
        if process.returncode is None:
            interrupt(process)
            await ended(process)


async def ended(process: asyncio.subprocess.Process, patience_s: float = PATIENCE_S) -> tuple[str, str]:
    """Wait for the end; returns what was written to standard output and standard error since they were last read."""
    try:
        async with asyncio.timeout(patience_s):
            out, err = await process.communicate()
    except TimeoutError:
        process.kill()
        await process.communicate()
        raise
    return out.decode(), err.decode()


async def said_in(stream: asyncio.StreamReader | None, *wanted: str) -> None:
    """Read lines until each of these was in one of them."""
    assert stream is not None
    missing, seen = set(wanted), list[str]()
    async with asyncio.timeout(PATIENCE_S):
        while missing:
            line = (await stream.readline()).decode()
            if not line:
                raise AssertionError(f"{missing} was never said: {''.join(seen[-10:])}")
            seen.append(line)
            missing = {words for words in missing if words not in line}


def log_lines(run: Path) -> list[dict[str, Any]]:
    """Return the lines of a run's event log behind its head."""
    lines = (run / "events.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    return [json.loads(line) for line in lines[1:] if line.endswith("\n")]


def notes(run: Path) -> list[dict[str, Any]]:
    """Return what was said to the operator, with its times."""
    return [line for line in log_lines(run) if "said" in line]


def began_unix_s(run: Path) -> float:
    """Return when the flight's clock was 0."""
    with (run / "events.jsonl").open(encoding="utf-8") as file:
        return float(json.loads(file.readline())["began_unix_s"])


GRAPH = """\
pylons_position = "{positions}"
connections_indexes = "{neighbours}"
"""


def graph_file(folder: Path, pylons: int, apart_m: float = 60.0) -> Path:
    """Write a line due east of the depot as a graph file."""
    positions = " ".join(f"{apart_m * number} 0 0;" for number in range(1, pylons + 1))
    rows = ["2"] + [f"{number - 1} {number + 1}" for number in range(2, pylons)] + [str(pylons - 1)]
    path = folder / "line.yaml"
    text = GRAPH.format(positions=positions, neighbours=" ".join(f"{row};" for row in rows))
    path.write_text(text, encoding="utf-8")
    return path


def site_file(
    folder: Path, *, pylons: int, vehicles: int, speedup: float, autopilot: str = "ardupilot", mavsdk: int = 0
) -> tuple[Path, list[int]]:
    """Write a site over a line of its own, and return it with the ports that the ground station listens on.

    The first `mavsdk` vehicles are reached through MAVSDK.
    """
    network, ports = graph_file(folder, pylons), free_ports(vehicles)
    text = f'[depot]\nlat_deg = 49.6\nlon_deg = 15.6\n[network]\nfile = "{network.name}"\n'
    text += f'[flight]\nspeedup = {speedup}\nfly_again = "auto"\n'
    for number, port in enumerate(ports, start=1):
        text += f'[[vehicle]]\nname = "uav{number}"\nconnection = "udpin://127.0.0.1:{port}"\n'
        backend = "mavsdk" if number <= mavsdk else "native"
        text += f'sysid = {number}\nautopilot = "{autopilot}"\nbackend = "{backend}"\n'
    path = folder / "site.toml"
    path.write_text(text, encoding="utf-8")
    return path, ports


def interrupt(process: asyncio.subprocess.Process) -> None:
    """Press Ctrl-C."""
    os.kill(process.pid, signal.SIGINT)
