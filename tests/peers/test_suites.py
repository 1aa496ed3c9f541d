"""What the published table of clients says to pass, passes."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.patience import PATIENCE_S
from tests.peers import judging, node_cases, suites
from tests.peers.judging import AUTOPILOTS, READY_S, Subject, Suite
from tests.peers.suites import HEAD, SUITES, Row
from tests.programs import leave_out

QUICK = {f"MAVSDK {plugin}" for plugin in ("action", "param", "geofence")}
"""What ./scripts/test holds; ./scripts/campaign holds all of them."""
HEARD = "MAVSDK telemetry"
"""Its cases only listen: they share a vehicle and a client."""
PASSED = [
    pytest.param(row.suite, row.autopilot, case, marks=() if row.suite in QUICK else pytest.mark.campaign)
    for row in suites.read_rows().values()
    if row.suite != HEARD
    for case in row.passed
]


def test_the_table_has_something_of_every_client_that_was_tried() -> None:
    assert {SUITES[row.suite].client for row in suites.read_rows().values() if row.passed} == {
        suite.client for suite in SUITES.values()
    }


@pytest.mark.asyncio
@pytest.mark.parametrize(("suite", "autopilot", "case"), PASSED)
async def test_a_case_of_the_table_passes(suite: str, autopilot: str, case: str) -> None:
    if not SUITES[suite].version:
        leave_out(f"{SUITES[suite].client} is not installed: {SUITES[suite].install}")
    assert await suites.find_fault(suite, autopilot, case, patience_s=PATIENCE_S - READY_S) == ""


@pytest.mark.asyncio
@pytest.mark.parametrize("autopilot", AUTOPILOTS)
async def test_all_that_is_only_heard_is_heard(autopilot: str) -> None:
    heard = suites.read_rows()[HEARD, autopilot].passed
    assert await suites.find_fault(HEARD, autopilot, *heard, patience_s=PATIENCE_S - READY_S) == ""


def test_a_row_is_read_as_it_was_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (page := tmp_path / "peers.md").write_text(f"# Clients\n\n{HEAD}\nThe end.\n", encoding="utf-8")
    monkeypatch.setattr(suites, "PAGE", page)
    rows = {
        ("MAVSDK ftp", "px4"): Row("MAVSDK ftp", "px4", ["upload", "rename"], 2, ["rename"]),
        ("MAVSDK ftp", "ardupilot"): Row("MAVSDK ftp", "ardupilot", [], 0, None),
        ("mavkit", "px4"): Row("mavkit", "px4", [], 11, []),
    }
    suites.write_rows(rows)
    assert suites.read_rows() == rows
    suites.write_rows(rows)
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# Clients\n\n| suite |")
    assert text.endswith("|\n\nThe end.\n")


@pytest.mark.asyncio
async def test_a_case_that_fails_says_why(tmp_path: Path) -> None:
    def fail(at: Subject) -> None:
        raise TimeoutError(f"{at.autopilot} says nothing")

    async def refuse(at: Subject) -> None:
        at.prove(lambda now: now.armed)

    suite = Suite("pytest", node_cases.lent, {"blocking": fail, "untrue": refuse})
    with judging.simulated("px4") as subject:
        assert await suite.find_fault(subject, "blocking") == "TimeoutError: px4 says nothing"
        assert "own state does not" in await suite.find_fault(subject, "untrue")
    assert suite.version
    assert not Suite("no-such-client", node_cases.lent, {}).version
