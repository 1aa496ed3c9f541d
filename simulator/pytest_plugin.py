"""A pytest plugin: simulated fleets for tests of any MAVLink program.

pytest loads this module in every session where faultline is installed, so it imports only pytest until a test requests
a fleet.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Generator, Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from simulator.testing import Fleet

MARKS = (
    "simulated_fleet(**options): the fleet of the fixture of this name, with the options of simulator.testing.fleet",
    "virtual_time(limit_s=3600): an async test in time that jumps to the next deadline, with a fleet in its event loop",
)
LIMIT_S = 3600.0
LAST_LINES = 200
"""Last dialogue lines in the report of a failed test."""


def pytest_configure(config: pytest.Config) -> None:
    """Register the marks."""
    for mark in MARKS:
        config.addinivalue_line("markers", mark)


@pytest.fixture(name="simulated_fleet")
def lend_fleet(request: pytest.FixtureRequest) -> Iterator[Fleet]:
    """A fleet in its own thread, configured by the mark of this name."""
    from simulator.testing import fleet

    mark = request.node.get_closest_marker("simulated_fleet")
    with fleet(*mark.args, **mark.kwargs) if mark else fleet() as living:
        yield living


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Run a coroutine marked `virtual_time`."""
    mark = pyfuncitem.get_closest_marker("virtual_time")
    if mark is None or not inspect.iscoroutinefunction(pyfuncitem.obj):
        return None
    import asyncio

    from simulator.virtual_loop import run_virtual

    arguments = {name: pyfuncitem.funcargs[name] for name in inspect.signature(pyfuncitem.obj).parameters}

    async def work() -> None:
        async with asyncio.timeout(mark.kwargs.get("limit_s", LIMIT_S)):
            await pyfuncitem.obj(**arguments)

    run_virtual(work)
    return True


def pytest_runtest_setup() -> None:
    """Forget the fleets of earlier tests."""
    if testing := sys.modules.get("simulator.testing"):
        testing.BEGUN.clear()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(  # pytest requires these names
    call: pytest.CallInfo[None],
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add clients' violations and the dialogue to the report of a failed test."""
    report = yield
    testing = sys.modules.get("simulator.testing")
    if testing is not None and report.failed and call.when == "call":
        for one in testing.BEGUN:
            lines = [*map(str, one.find_violations()), *one.transcript.splitlines()[-LAST_LINES:]]
            report.sections.append(("dialogue with the simulated fleet", "\n".join(lines)))
    return report
