"""The campaign over real logs, on a few generated ones: counts, failures, and the page."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from benchmarks import reallogs
from benchmarks.reallogs import aircraft_of, compute_clustered_interval, judge_logs, real_summary
from benchmarks.reallogspage import print_real, real_document, real_markdown
from benchmarks.store import keep_result
from benchmarks.witness.log_evidence import Controller
from benchmarks.witness.statements import read_log_evidence
from executor.cli import main
from tests.onboard import DataFlashWriter
from tests.recorded import Writer, flight, heartbeat, position, station, text

SILENT = "some+repo__silent.tlog"


def folder_of_logs(tmp_path: Path) -> Path:
    """Return a folder with a link that is lost, a crash, an aeroplane, what is no log, and one log with a truth."""
    silent, crash, plane, known = Writer(), Writer(), Writer(), Writer()
    flight(silent, 3, range(150), silent=range(60, 72))
    for second in range(150):
        silent.say(second + 0.7, 255, station())
        crash.say(second + 0.1, 4, heartbeat(armed=second < 90))
        crash.say(second + 0.3, 4, position(second, 3.0 * second, 20.0 if second < 90 else 0.0))
        plane.say(second + 0.1, 9, heartbeat(kind=1))
    crash.say(89.9, 4, text("Crash: Disarming", 2))
    flight(known, 3, range(30))
    logs = tmp_path / "logs"
    (logs / "hangar").mkdir(parents=True)
    silent.write(logs / SILENT)
    crash.write(logs / "hangar" / "crash.tlog")
    plane.write(logs / "plane.tlog")
    known.write(logs / "known.tlog")
    (logs / "known_truth.json").write_text(json.dumps({"logs": {"known.tlog": {"kind": "no fault", "events": []}}}))
    (logs / "noise.BIN").write_bytes(bytes(range(256)) * 40)
    (logs / "broken.ulg").write_bytes(b"ULog\x01\x12\x35" + b"\x00" * 20)
    (logs / "cut.tlog").write_bytes(silent.data()[:3000][:-5])
    (logs / "notes.txt").write_text("no log")
    return logs


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    return judge_logs(folder_of_logs(tmp_path_factory.mktemp("campaign")), 2)


def named(rows: list[dict[str, Any]], name: str) -> dict[str, Any]:
    return next(row for row in rows if row["log"] == name)


def test_every_log_is_judged_but_those_with_a_truth(rows: list[dict[str, Any]]) -> None:
    assert {row["log"] for row in rows} == {
        SILENT, "hangar/crash.tlog", "plane.tlog", "noise.BIN", "broken.ulg", "cut.tlog",
    }  # fmt: skip
    assert [row["failed"] for row in rows] == [""] * len(rows)


def test_a_gap_is_stated_and_declared(rows: list[dict[str, Any]]) -> None:
    row = named(rows, SILENT)
    [declared] = [one for one in row["declared"] if one["by"] == "watchpoints"]
    assert (declared["kind"], declared["verdict"]) == ("link", "confirmed")
    [stated] = row["stated"]
    assert stated["what"] == "link gap"
    assert stated["watchpoints"]["outcome"] == "declared"
    assert 0 <= stated["watchpoints"]["after_s"] <= 2.0
    assert row["aircraft"] == "some+repo"
    assert row["hours"] == pytest.approx(150 / 3600, rel=0.1)


def test_a_crash_is_stated(rows: list[dict[str, Any]]) -> None:
    [stated] = named(rows, "hangar/crash.tlog")["stated"]
    assert (stated["what"], stated["words"]) == ("crash", "Crash: Disarming")
    assert stated["few_lines"] == {"outcome": "missed", "after_s": None}
    assert named(rows, "hangar/crash.tlog")["aircraft"] == "hangar"


def test_what_cannot_be_followed_is_counted_with_its_reason(rows: list[dict[str, Any]]) -> None:
    figures = real_summary(rows)
    assert figures["logs"] == 6
    assert sum(figures["not_followed"].values()) == figures["logs"] - figures["followed"]
    assert any("MAV_TYPE 1" in reason for reason in figures["not_followed"])


def test_the_page(rows: list[dict[str, Any]], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content = real_document(tmp_path, rows)
    keep_result("real-logs", content, real_markdown(content), tmp_path / "out")
    read = json.loads((tmp_path / "out" / "real-logs.json").read_text())
    assert read["watchpoints"]["refuted"] == sum(
        one["verdict"] == "refuted" for row in rows for one in row["declared"] if one["by"] == "watchpoints"
    )
    page = (tmp_path / "out" / "real-logs.md").read_text()
    assert "| link: link | 1 | 1 | 0 | 0 |" in page
    assert "| link gap, watchpoints | 1 | 1 | 0 | 0 |" in page
    print_real(content)
    assert "link gap: 1 stated, 1 in time" in capsys.readouterr().out


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    logs = folder_of_logs(tmp_path)
    with pytest.raises(SystemExit) as left:
        main.main(["bench", "detection", "--logs", str(logs), "--jobs", "1", "--out", str(tmp_path / "out"), "--json"])
    assert left.value.code == 0
    content = json.loads(capsys.readouterr().out)
    assert content["real"]["logs"] == 6
    assert [row["log"] for row in content["recorded"]] == ["known.tlog"]
    assert "watchpoints" not in content, "no modelled flights were asked for"
    assert (tmp_path / "out" / "real-logs.md").is_file()
    assert not (tmp_path / "out" / "detection.md").exists()
    with pytest.raises(SystemExit) as left:
        main.main(["bench", "detection", "--logs", str(tmp_path / "none")])
    assert left.value.code == 2


def _dies(path: Path, folder: Path) -> dict[str, Any]:
    if path.name == SILENT:
        os._exit(3)
    return {"log": path.name, "aircraft": "a", "hours": 0.1, "vehicles": 1, "notes": [], "failed": "",
            "declared": [], "stated": []}  # fmt: skip


def test_a_log_that_kills_its_process_is_counted_and_the_others_are_judged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reallogs, "judge_log", _dies)
    rows = judge_logs(folder_of_logs(tmp_path), 2)
    assert len(rows) == 6
    assert [row["log"] for row in rows if row["failed"]] == [SILENT]
    assert real_summary(rows)["failed"] == [f"{SILENT}: its process died"]


def test_an_error_of_the_program_is_counted_and_not_raised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("a mistake")

    monkeypatch.setattr(reallogs, "replay_log", broken)
    logs = folder_of_logs(tmp_path)
    assert reallogs.judge_log(logs / SILENT, logs)["failed"] == "ZeroDivisionError: a mistake"


def test_flights_of_one_aircraft_go_wrong_together() -> None:
    hours = {f"a{number}": 2.0 for number in range(10)}
    spread = compute_clustered_interval(dict.fromkeys(hours, 1), hours)
    together = compute_clustered_interval({"a0": 10}, hours)
    assert spread == (25.0, 25.0)
    assert together[0] == 0.0
    assert together[1] > 50.0
    # Nothing wrong in so many hours: up to Poisson's 3.7, not "never".
    assert compute_clustered_interval({}, {"a": 50.0}) == pytest.approx((0.0, 3.69), abs=0.01)


@pytest.mark.parametrize(
    ("name", "aircraft"),
    [("owner+repo__a_b.tlog", "owner+repo"), ("hangar/a.tlog", "hangar"), ("a__b.tlog", "system 2")],
)
def test_the_aircraft_of_a_log(name: str, aircraft: str, tmp_path: Path) -> None:
    assert aircraft_of(tmp_path / name, tmp_path, (7, 2)) == aircraft


def test_a_mode_in_an_old_log_is_judged_by_its_reason(tmp_path: Path) -> None:
    writer = DataFlashWriter()
    writer.say("PARM", "QNf", "TimeUS,Name,Value", 1_000_000, "SYSID_THISMAV", 7.0)
    writer.say("MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn", 1_500_000, 3, 3, 2)
    writer.say("MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn", 9_000_000, 6, 6, 4)
    writer.say("ERR", "QBB", "TimeUS,Subsys,ECode", 9_100_000, 6, 1)
    told = read_log_evidence(writer.write(tmp_path / "a.BIN"))[7]
    assert [(one.mode, one.by) for one in told.modes] == [(3, Controller.STATION), (6, Controller.FAILSAFE)]
    assert [one.kind for one in told.failings] == ["battery"]
