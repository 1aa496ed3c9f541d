"""What node-mavlink, a MAVLink library in TypeScript, can do with a vehicle."""

from __future__ import annotations

import asyncio
import json
from asyncio.subprocess import PIPE
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from shutil import which

from tests.peers.judging import Subject, Suite

CLIENT = Path(__file__).with_name("node_client.mjs")
MODULES = Path(__file__).parents[2] / "node_modules"
NAMES = (
    "every frame is understood", "all parameters", "set a parameter", "mission", "fence", "rally points",
    "a message on request", "a message's interval", "arm and disarm", "an unknown command is refused",
)  # fmt: skip


def find_package(name: str) -> str:
    """Return the version of a package that npm has installed here; empty where there is none, or no Node.js."""
    described = MODULES / name / "package.json"
    if not described.exists() or which("node") is None:
        return ""
    return str(json.loads(described.read_text(encoding="utf-8"))["version"])


@asynccontextmanager
async def lent(subject: Subject) -> AsyncIterator[Subject]:
    yield subject


def by_node(name: str) -> Callable[[Subject], Awaitable[None]]:
    """Return a case of `node_client.mjs`."""

    async def case(at: Subject) -> None:
        port = at.connection.rpartition(":")[2]
        how = "listen" if at.vehicle is None else "call"
        process = await asyncio.create_subprocess_exec("node", str(CLIENT), name, port, how, stderr=PIPE)
        try:
            _, said = await process.communicate()
        except asyncio.CancelledError:
            process.kill()
            raise
        assert process.returncode == 0, said.decode(errors="replace").strip().splitlines()[-1]

    return case


SUITES = {
    "node-mavlink": Suite(
        "node-mavlink", lent, {name: by_node(name) for name in NAMES}, find_version=find_package, install="npm ci"
    ),
}  # fmt: skip
