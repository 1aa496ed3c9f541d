"""Whole flights over UDP: losses are detected, the rest is finished, and the operator can end supervision."""

from __future__ import annotations

import asyncio
import json
import re
import socket
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mav

from executor.adapters.run_directory import RunDirectory
from executor.core.battery.kalman import Prior
from executor.core.vehicle_learning import KnownVehicle, PaceEstimate
from executor.replay.run_replay import replay_run
from executor.site.learned_files import LearnedDocument, build_learned_document
from planner import PRESETS
from simulator.truth import read_truths
from tests.e2e.flights import (
    Flown,
    began_unix_s,
    called,
    demo,
    ended,
    graph_file,
    interrupt,
    log_lines,
    notes,
    said_in,
    site_file,
)
from tests.e2e.judge import wrongly_counted
from tests.patience import PATIENCE_S
from tests.scripts.pages.test_schemas import validator

pytestmark = pytest.mark.asyncio

LEAST_APART_M = 5.0
ARDUPILOT_AUTO = 3


def finished(flown: Flown) -> None:
    """Check what every flight that ends well has in common."""
    report = flown.report
    assert flown.code == 0
    assert report["finished"]
    assert report["segments_inspected"] == report["segments_total"] > 0
    assert report["segments_uncovered"] == []
    assert report["min_separation_m"] >= LEAST_APART_M
    assert not any("internal error" in line for line in flown.said)


def lost(flown: Flown) -> list[tuple[str, str]]:
    return [(fault["vehicle"], fault["kind"]) for fault in flown.report["faults"]]


async def test_a_silent_link(tmp_path: Path) -> None:
    flown = await demo(tmp_path / "run", "uav2:silent@40%")
    finished(flown)
    assert lost(flown) == [("uav2", "link")]
    [fault], [replan] = flown.report["faults"], flown.report["replans"]
    assert replan["feasible"]
    # Where the computer stands still for a moment, what came before may be read after it: the streams are missed first.
    assert re.match(r"uav2: (link lost|neither HEARTBEAT nor position) for ", replan["trigger"])
    assert fault["detected_s"] - fault["happened_s"] >= 10.0
    assert all(one["landed"] for one in flown.report["vehicles"] if one["name"] != "uav2")
    assert min(one["min_reserve_pct"] for one in flown.report["vehicles"]) >= 15.0
    written = {path.name for path in flown.run.iterdir()}
    assert {"site.toml", "events.jsonl", "plan-000.json", "plan-001.json", "report.json", "uav1.tlog"} <= written
    documents = {"plan": "plan-*.json", "report": "report.json", "vehicles": "vehicles.json", "learned": "learned.json"}
    for name, files in documents.items():
        assert list(flown.run.glob(files))
        for path in flown.run.glob(files):
            validator(name).validate(json.loads(path.read_text(encoding="utf-8")))
    again = replay_run(flown.run)
    assert (again.comparison.first_difference, again.comparison.reworded) == ("", "")
    assert again.comparison.logged > 10
    [declared] = [one for vehicle in again.vehicles for one in vehicle.declarations]
    assert declared.evidence == fault["reason"]


async def test_a_battery_step_on_px4(tmp_path: Path) -> None:
    flown = await demo(tmp_path / "run", "uav3:battery-step=30@20%", autopilot="px4")
    finished(flown)
    assert lost(flown) == [("uav3", "battery")]
    [fault] = flown.report["faults"]
    assert fault["detected_s"] - fault["happened_s"] < 30.0
    assert flown.vehicle("uav3")["landed"]
    assert len(flown.report["replans"]) == 1


async def test_a_fast_drain(tmp_path: Path) -> None:
    flown = await demo(tmp_path / "run", "uav1:drain=3@20%")
    finished(flown)
    assert lost(flown) == [("uav1", "battery")]
    assert flown.vehicle("uav1")["landed"]


async def test_a_fifth_of_everything_lost(tmp_path: Path) -> None:
    flown = await demo(tmp_path / "run", "all:loss=0.2@0s", "uav2:silent@40%")
    finished(flown)
    assert lost(flown) == [("uav2", "link")]
    assert not any("upload of its new mission failed" in line for line in flown.said)


async def test_one_crashes_and_one_comes_back(tmp_path: Path) -> None:
    """Both are mission interruptions; what is heard again is on its way home, by its own failsafe or by our order."""
    flown = await demo(tmp_path / "run", "uav2:silent=90s@30%", "uav3:crash@60%")
    finished(flown)
    assert sorted(lost(flown)) == [("uav2", "link"), ("uav3", "interruption")]
    assert any(line.startswith("uav2: link regained, returning") for line in flown.said)
    assert flown.vehicle("uav2")["landed"]
    assert not flown.vehicle("uav3")["landed"]
    known = {row["segment"]: row["vehicle"] for row in flown.report["inspections"]}
    assert len(known) == flown.report["segments_total"]
    assert {row["firmware"] for row in flown.report["vehicles"]} == {"4.7.0-dev"}


async def test_a_survivor_that_refuses_its_new_mission(tmp_path: Path) -> None:
    flown = await demo(tmp_path / "run", "uav2:battery-step=30@30%", "uav3:refuse-upload@10%")
    finished(flown)
    assert lost(flown) == [("uav2", "battery")]
    assert any(line.startswith("uav3: upload of its new mission failed") for line in flown.said)
    triggers = [row["trigger"] for row in flown.report["replans"]]
    assert triggers[0].startswith("uav2: battery")
    assert triggers[1].startswith("uav3: mission refused")
    # It is offered its part again as long as it answers, three times at most.
    assert all(trigger.startswith(("uav3: answers again", "uav3: mission refused")) for trigger in triggers[2:])
    assert triggers.count("uav3: answers again") <= 3
    assert flown.vehicle("uav3")["segments"]
    assert flown.vehicle("uav3")["landed"]


async def test_at_the_speed_of_life(tmp_path: Path) -> None:
    """A silent link is declared within its time-out and half a second; two seconds later the re-plan is on board."""
    run, network = tmp_path / "run", graph_file(tmp_path, 5)
    arguments = ["demo", "--network", str(network), "--vehicles", "2", "--speedup", "1", "--run", str(run)]
    async with called(*arguments, "--fault", "uav2:silent@15s") as process:
        await said_in(process.stderr, "re-plan 1 is on board")
    timeout_s = 10.0
    [silent_unix_s] = [one.unix_s for one in read_truths(run / "truth.jsonl") if one.what.startswith("fault ")]
    silent_s = silent_unix_s - began_unix_s(run)
    declared_s = next(note["t_s"] for note in notes(run) if note["said"].startswith("uav2: link lost for "))
    on_board_s = next(note["t_s"] for note in notes(run) if note["said"].startswith("re-plan 1 is on board"))
    heard = [line["t_s"] for line in log_lines(run) if line.get("event", {}).get("vehicle") == "uav2"]
    last_heard_s = max(at_s for at_s in heard if at_s <= declared_s)
    assert timeout_s <= declared_s - last_heard_s <= timeout_s + 0.5
    assert declared_s - silent_s <= timeout_s + 0.5
    assert on_board_s - declared_s <= 2.0


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
async def test_a_loss_among_vehicles_that_are_reached_through_mavsdk(autopilot: str, tmp_path: Path) -> None:
    """One of them is lost, the other takes over with the one on the native link."""
    site, _ = site_file(tmp_path, pylons=10, vehicles=3, speedup=10.0, autopilot=autopilot, mavsdk=2)
    run = tmp_path / "run"
    simulate = ["simulate", str(site), "--fault", "uav2:silent@40%"]
    fly = ["fly", str(site), "--yes", "--json", "--run", str(run)]
    async with called(*simulate), called(*fly) as flight:
        out, err = await ended(flight)
    assert flight.returncode == 0, err
    flown = Flown(run, 0, json.loads(out), [note["said"] for note in notes(run)])
    finished(flown)
    assert lost(flown) == [("uav2", "link")]
    assert [replan["feasible"] for replan in flown.report["replans"]] == [True]
    assert wrongly_counted(run, flown.report) == []
    for name, counted in (("uav1", False), ("uav3", True)):
        assert flown.vehicle(name)["landed"]
        assert flown.vehicle(name)["segments"]
        # MAVSDK shows no sequence numbers, so nobody knows what was lost on its way.
        assert (flown.vehicle(name)["frames_missing"] is not None) is counted


async def started(folder: Path, speedup: float) -> tuple[list[str], list[str], list[int], Path]:
    """Return the calls of a simulation and of a flight over it, the ports between them, and the truth's file."""
    site, ports = site_file(folder, pylons=8, vehicles=2, speedup=speedup)
    truth = folder / "truth.jsonl"
    simulate = ["simulate", str(site), "--truth", str(truth)]
    return simulate, ["fly", str(site), "--yes", "--run", str(folder / "run")], ports, truth


async def heartbeat_on(port: int) -> Any:
    """Return the next heartbeat that a vehicle sends to a port."""
    parser = mav.MAVLink(None)
    parser.robust_parsing = True
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plug:
        plug.bind(("127.0.0.1", port))
        plug.setblocking(False)
        async with asyncio.timeout(PATIENCE_S):
            while True:
                data = await asyncio.get_running_loop().sock_recv(plug, 4096)
                for message in parser.parse_buffer(data) or []:
                    if message.get_type() == "HEARTBEAT":
                        return message


async def test_without_a_yes_nothing_moves(tmp_path: Path) -> None:
    simulate, fly, _, truth = await started(tmp_path, speedup=30.0)
    async with called(*simulate), called(*(one for one in fly if one != "--yes")) as flight:
        _, err = await ended(flight)
    assert flight.returncode == 2
    assert "page: http://" in err  # where the plan could be looked at
    assert "Take off?" not in err  # nobody is there to be asked
    assert err.rstrip().endswith("not confirmed; nothing was changed on board")
    happened = [one.what for one in read_truths(truth)]
    assert all(what.startswith(("order command 511 ", "order command 512 ")) for what in happened), "asked, not told"
    assert not (tmp_path / "run" / "events.jsonl").exists()


async def test_ctrl_c_once_leaves_the_vehicles_on_their_missions(tmp_path: Path) -> None:
    simulate, fly, ports, truth = await started(tmp_path, speedup=5.0)
    async with called(*simulate) as simulation:
        async with called(*fly) as flight:
            await said_in(flight.stderr, "uav1: flies its mission", "uav2: flies its mission")
            interrupt(flight)
            await said_in(flight.stderr, "Ctrl-C: the vehicles stay on their missions")
            _, err = await ended(flight)
            assert flight.returncode == 1
            assert "supervision ends; the vehicles continue what they are doing" in err
        for port in ports:
            beat = await heartbeat_on(port)
            assert beat.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED
            assert beat.custom_mode == ARDUPILOT_AUTO
        assert simulation.returncode is None
    assert "landed" not in {one.what for one in read_truths(truth)}


async def test_what_one_flight_taught_is_where_the_next_one_begins(tmp_path: Path) -> None:
    simulate, fly, _, _ = await started(tmp_path, speedup=20.0)
    before, factor = tmp_path / "before", PaceEstimate(1.1, 0.02**2, 30)
    before.mkdir()
    known = {"uav1": KnownVehicle(factor, factor, Prior(1.1, 0.04), 20.0, "ardupilot", PRESETS["mavic3"].name)}
    build_learned_document(known, "2026-01-02").write(RunDirectory(before).learned)
    words = "uav1: inspections take 110 ± 2 % of the model's time"
    async with called(*simulate):
        async with called("preflight", fly[1], "--learned", str(before)) as check:
            out, err = await ended(check)
            assert check.returncode == 0, err
            assert words in out + err
        async with called(*fly, "--learned", str(before)) as flight:
            out, err = await ended(flight)
            assert flight.returncode == 0, err
            assert words in out + err
    run = RunDirectory(tmp_path / "run")
    assert LearnedDocument.read(run.learned_before).known_by_name["uav1"].consumption == known["uav1"].consumption
    rows = {row.name: row for row in LearnedDocument.read(run.learned).vehicles}
    assert rows["uav1"].inspect.legs > 30
    assert rows["uav2"].inspect.legs > 0
    # It is not thirsty today.
    assert rows["uav1"].consumption.mean < 1.1


async def test_ctrl_c_twice_sends_them_home(tmp_path: Path) -> None:
    simulate, fly, _, truth = await started(tmp_path, speedup=20.0)
    async with called(*simulate) as simulation, called(*fly) as flight:
        await said_in(simulation.stdout, "uav1: took_off", "uav2: took_off")
        interrupt(flight)
        await said_in(flight.stderr, "Ctrl-C: the vehicles stay on their missions")
        interrupt(flight)
        await said_in(flight.stderr, "flight aborted by the operator, all vehicles return")
        out, _ = await ended(flight)
        assert flight.returncode == 1
        assert "not inspected: " in out
    whats = [(one.vehicle, one.what) for one in read_truths(truth)]
    assert {("uav1", "landed"), ("uav2", "landed")} <= set(whats)
    assert "crash" not in {what for _, what in whats}
    report = json.loads((tmp_path / "run" / "report.json").read_text(encoding="utf-8"))
    assert [one["landed"] for one in report["vehicles"]] == [True, True]
    assert report["segments_inspected"] < report["segments_total"]
