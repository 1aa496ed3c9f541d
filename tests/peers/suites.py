"""What clients that nobody here wrote can do with a vehicle, case by case, and the table that says so.

    python -m tests.peers.suites [SUITE ...]          tries every case with simulated vehicles
    python -m tests.peers.suites --again [SUITE ...]  tries those that failed once more
    python -m tests.peers.suites --real [SUITE ...]   tries those that failed with real autopilots (docs/sitl.md)
    python -m tests.peers.suites --real --all [SUITE ...]   tries all of them

SUITE is the beginning of a name in the table: MAVProxy, or "MAVSDK ftp". Each case prints why it failed; the rows of
docs/results/peers.md are written anew.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.peers import (
    configurator_cases,
    dronekit_cases,
    mavkit_cases,
    mavproxy_cases,
    mavsdk_cases,
    node_cases,
    pymavlink_cases,
)
from tests.peers.judging import PATIENCE_S, READY_S, Suite, find_real, real_one, simulated, wait

PAGE = Path(__file__).parents[2] / "docs" / "results" / "peers.md"
HEAD = (
    "| suite | version | autopilot | cases | passed | failed | tried with the real one | there otherwise |\n"
    "| --- | --- | --- | ---: | ---: | --- | ---: | --- |\n"
)
NOTHING = "nothing"
SUITES: Mapping[str, Suite[Any]] = {
    **mavsdk_cases.SUITES, **mavproxy_cases.SUITES, **pymavlink_cases.SUITES, **configurator_cases.SUITES,
    **dronekit_cases.SUITES, **mavkit_cases.SUITES, **node_cases.SUITES,
}  # fmt: skip


@dataclass(slots=True)
class Row:
    """What the table says of a suite and an autopilot."""

    suite: str
    autopilot: str
    failed: list[str]
    tried: int = 0
    """With the real one."""
    otherwise: list[str] | None = None
    """Cases that came out differently there."""

    @property
    def passed(self) -> list[str]:
        return [name for name in SUITES[self.suite].cases if name not in self.failed]

    def __str__(self) -> str:
        suite = SUITES[self.suite]
        otherwise = "" if self.otherwise is None else ", ".join(self.otherwise) or NOTHING
        cells = (
            self.suite, suite.version, self.autopilot, len(suite.cases), len(self.passed),
            ", ".join(self.failed) or NOTHING, self.tried, otherwise,
        )  # fmt: skip
        return f"| {' | '.join(map(str, cells))} |"


def read_rows() -> dict[tuple[str, str], Row]:
    """Return the published table, by suite and autopilot."""
    rows = dict[tuple[str, str], Row]()
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split(" | ")]
        if len(cells) == 8 and cells[0] in SUITES:
            suite, _, autopilot, _, _, failed, tried, otherwise = cells
            names = split(otherwise) if otherwise else None
            rows[suite, autopilot] = Row(suite, autopilot, split(failed), int(tried), names)
    return rows


def split(cell: str) -> list[str]:
    return [] if cell == NOTHING else cell.split(", ")


def write_rows(rows: Mapping[tuple[str, str], Row]) -> None:
    """Write the table between what stands before and after it."""
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition("| suite |")
    after = rest.rpartition("|\n")[2]
    table = [str(rows[key]) + "\n" for key in list_rows() if key in rows]
    PAGE.write_text(f"{before}{HEAD}{''.join(table)}{after}", encoding="utf-8")


def list_rows(only: Sequence[str] = ("",)) -> Iterator[tuple[str, str]]:
    """Yield suites with their autopilots."""
    for name, suite in SUITES.items():
        if name.startswith(tuple(only)):
            yield from ((name, autopilot) for autopilot in suite.autopilots)


async def find_fault(suite: str, autopilot: str, *cases: str, patience_s: float = PATIENCE_S) -> str:
    """Return why a case fails with a simulated vehicle, or the first of several with one; nothing where they pass."""
    with simulated(autopilot) as subject:
        return await SUITES[suite].find_fault(subject, *cases, patience_s=patience_s)


async def find_real_fault(suite: str, autopilot: str, case: str) -> str:
    """Return why a case fails with a real autopilot of its own; nothing where it passes."""
    with real_one(autopilot) as subject:
        await asyncio.to_thread(wait, subject.is_ready, READY_S)
        return await SUITES[suite].find_fault(subject, case)


async def try_simulated(row: Row, cases: Sequence[str]) -> None:
    """Try cases of a row."""
    row.failed = []
    for case in cases:
        if fault := await find_fault(row.suite, row.autopilot, case):
            row.failed.append(case)
            print(f"  {row.autopilot}, {row.suite}, {case}: {fault}", flush=True)


async def try_real(row: Row, cases: Sequence[str]) -> None:
    """Try cases of a row with the real one."""
    row.tried, row.otherwise = len(cases), []
    for case in cases:
        fault = await find_real_fault(row.suite, row.autopilot, case)
        if bool(fault) != (case in row.failed):
            row.otherwise.append(case)
        print(f"  real {row.autopilot}, {row.suite}, {case}: {fault or 'passes'}", flush=True)


async def main(arguments: Sequence[str]) -> None:
    """Try what is asked for and write the page."""
    parser = argparse.ArgumentParser(prog="python -m tests.peers.suites", description=__doc__)
    parser.add_argument("suites", nargs="*", metavar="SUITE")
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--real", action="store_true")
    parser.add_argument("--all", action="store_true")
    asked = parser.parse_args(arguments)
    rows = read_rows()
    for suite, autopilot in list_rows(asked.suites or ("",)):
        row = rows.setdefault((suite, autopilot), Row(suite, autopilot, []))
        if not asked.real:
            await try_simulated(row, row.failed if asked.again else list(SUITES[suite].cases))
        elif find_real(autopilot):
            await try_real(row, list(SUITES[suite].cases) if asked.all else row.failed)
        print(row, flush=True)
        write_rows(rows)


if __name__ == "__main__":
    asyncio.new_event_loop().run_until_complete(main(sys.argv[1:]))
    os._exit(0)  # some clients' questions have no end where nobody answers
