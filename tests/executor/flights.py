"""A small flight with figures that can be worked out by hand, written as a run directory by the real writers.

Five segments of 100 m lie due east of the depot, from 100 m on. Transit is 10 m/s, inspection 5 m/s, and a second of
either takes 0.1 %. Times are seconds since the launch:

- uav1 inspects segment 3 (40 to 60) and segment 4 (60 to 80). Then, by the re-plan that it begins at 60, segment 2 on
  its way home (100 to 120), and is home at 150.
- uav2 inspects segment 0 (10 to 30), is silent from 40 on, in the midst of segment 1, and is lost at 50.
- uav3 has nothing to do until the re-plan. It climbs at 62, inspects segment 1 (82 to 102), and is home at 132. In the
  flight that does not finish, its mission cannot be put on board.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import tomlkit

from executor.adapters.eventlog import EventLog
from executor.analysis.documents import FaultRow, FlightReport
from executor.core.interface.events import Event, Heard, LaunchOrdered, NewRoute, SolveEnded, UploadEnded
from executor.core.interface.messages import Battery, Position
from executor.core.state.vehicle_state import FaultKind
from missions import Inspection, PlanFile, SolverRecord, make_plan_file, write_plan
from planner import Cost, Plan, RiskCampaign, Route, Travel, Vehicle, build_risk_campaign
from tests.missions.builders import FRAME, line_east, paper_task

LAUNCH_S = 50.0
"""In the ground station's time."""
NAMES = ("uav1", "uav2", "uav3")
NETWORK = line_east(6)
TRAVEL = Travel(10.0, 5.0, 0.1, 0.1)
INSPECTION = Inspection(standoff_m=0.0, speed_m_s=5.0, transit_speed_m_s=10.0)

# Seconds and metres east at every turn of each flight.
_UAV1 = ((0, 0), (40, 400), (80, 600), (100, 400), (120, 300), (150, 0))
_UAV2 = ((0, 0), (10, 100), (40, 250))
_UAV3 = ((0, 0), (62, 0), (82, 200), (102, 300), (132, 0))


def first_plan_file() -> PlanFile:
    """Return the first plan: uav1 has segments 3 and 4, uav2 has 0, 1 and 2, uav3 is a spare."""
    vehicles = [Vehicle(name, (0.0, 0.0), 75.0) for name in NAMES]
    task = paper_task(NETWORK, range(5), vehicles, TRAVEL)
    plan = Plan((Route(0, (6, 8)), Route(1, (0, 2, 4)), Route(2, ())))
    return make_plan_file(
        NETWORK, task, TRAVEL, plan, Cost.MINMAX, SolverRecord("search", 1, 0.1), inspection=INSPECTION
    )


def first_campaign() -> RiskCampaign:
    """Return the first plan to be flown many times, with losses."""
    content = first_plan_file()
    return build_risk_campaign(
        content.build_instance(), content.plan, mtbf_h=(0.1,), battery_spread_pct=10.0, max_losses=2, effort=100
    )


def second_plan_file() -> PlanFile:
    """Return the re-plan: from 500 m east uav1 has segments 4 and 2 (backwards), uav3 has segment 1 from its pad."""
    vehicles = [Vehicle("uav1", (500.0, 0.0), 60.0, airborne=True), Vehicle("uav3", (0.0, 0.0), 70.0)]
    task = paper_task(NETWORK, (1, 2, 4), vehicles, TRAVEL)
    plan = Plan((Route(0, (4, 3)), Route(1, (0,))))
    return make_plan_file(
        NETWORK, task, TRAVEL, plan, Cost.MINCOMB, SolverRecord("search", 1, 0.1), inspection=INSPECTION
    )


def write_run(run: Path, *, finished: bool = True) -> FlightReport:
    """Write the flight's run directory, and return the content of its report.json."""
    (run / "site.toml").write_text(tomlkit.dumps(_site()))
    write_plan(run / "plan-000.json", first_plan_file())
    write_plan(run / "plan-001.json", second_plan_file())
    log = EventLog(run / "events.jsonl", began_unix_s=1.8e9, speedup=2.0)
    for t_s, entry in sorted(_entries(finished=finished), key=lambda pair: pair[0]):
        if isinstance(entry, str):
            level = "fault" if "lost" in entry else "info"
            log.note(LAUNCH_S + t_s, said=entry, level=level)
        else:
            log.write(entry, LAUNCH_S + t_s)
    log.close()
    report = FlightReport.model_validate(_report(finished=finished))
    report.write(run / "report.json")
    return report


def short_report(uncovered: list[int], *lost: str) -> FlightReport:
    """Return the least that a report says of a flight over six segments: what it left over, and who was lost."""
    return FlightReport(
        format="faultline-report/1",
        segments_total=6,
        segments_inspected=6 - len(uncovered),
        segments_uncovered=tuple(uncovered),
        finished=not uncovered,
        duration_s=100.0,
        faults=tuple(
            FaultRow(vehicle=name, kind=FaultKind.LINK, reason="silent", happened_s=None, detected_s=9.0)
            for name in lost
        ),
        replans=(),
        vehicles=(),
        min_separation_m=None,
    )


def _entries(*, finished: bool) -> list[tuple[float, Event | str]]:
    entries: list[tuple[float, Event | str]] = [
        (0.0, LaunchOrdered()),
        (50.0, "uav2: lost, silent for 10 s <again>"),
        (51.0, SolveEnded(1, (NewRoute("uav1", (8, 5)), NewRoute("uav3", (2,))), (), 0.1, "")),
        (52.0, UploadEnded("uav1", 1, accepted=True, mixed=False, reason="")),
        (60.0, UploadEnded("uav3", 1, accepted=finished, mixed=False, reason="" if finished else "refused")),
        (150.0, "uav1: landed with 85 %"),
    ]
    for name, turns in (("uav1", _UAV1), ("uav2", _UAV2), ("uav3", _UAV3 if finished else _UAV3[:2])):
        begins_s, ends_s = (62, turns[-1][0]) if name == "uav3" and finished else (0, turns[-1][0])
        t_s, east_m = zip(*turns, strict=True)
        for second in range(ends_s + 1):
            flying = begins_s < second < ends_s and not (name == "uav3" and not finished)
            place_m = float(np.interp(second, t_s, east_m))
            entries.append((second, Heard(name, _position(second, place_m, 30.0 if flying else 0.0))))
            if second % 10 == 0:
                used_pct = 0.1 * max(0, second - begins_s) if finished or name != "uav3" else 0.0
                entries.append((second, Heard(name, Battery(0, 100.0 - used_pct, None, None, None, 1, 0))))
    return entries


def _position(second: int, east_m: float, alt_rel_m: float) -> Position:
    lat_deg, lon_deg = FRAME.to_wgs84_deg(east_m, 0.0)
    return Position(7.0 + second, lat_deg, lon_deg, FRAME.alt_m + alt_rel_m, alt_rel_m, 0.0, 0.0, 0.0, None)


def _site() -> dict[str, object]:
    return {
        "network": {"file": "default"},
        "inspection": {"standoff_m": 0.0, "speed_m_s": 5.0, "transit_speed_m_s": 10.0},
        "flight": {"speedup": 2.0},
        "vehicle": [
            {"name": name, "connection": f"udpin://127.0.0.1:{15000 + number}", "sysid": number, "autopilot": "px4"}
            for number, name in enumerate(NAMES, start=1)
        ],
    }


def _report(*, finished: bool) -> dict[str, object]:
    segments = {"uav1": [2, 3, 4], "uav2": [0], "uav3": [1] if finished else []}
    replan = {
        "revision": 1,
        "trigger": "uav2: link",
        "feasible": True,
        "solve_s": 0.1,
        "upload_s": 9.0,
        "total_s": 10.0,
        "gained": 1,
        "longest_route_s": 90.0,
    }
    fault = {"vehicle": "uav2", "kind": "link", "reason": "link lost for 10 s", "happened_s": 40.0, "detected_s": 50.0}
    return {
        "format": "faultline-report/1",
        "segments_total": 5,
        "segments_inspected": 5 if finished else 4,
        "segments_uncovered": [] if finished else [1],
        "finished": finished,
        "duration_s": 150.0,
        "faults": [fault],
        "replans": [{**replan, "uncovered": []}],
        "vehicles": [
            {
                "name": name,
                "segments": segments[name],
                "energy_used_pct": 15.0,
                "landed": name != "uav2",
                "min_reserve_pct": 85.0,
                "state": "lost" if name == "uav2" else "landed",
                "type": "quadrotor",
                "autopilot": "PX4",
                "firmware": "1.17.0",
            }
            for name in NAMES
        ],
        "checks": [
            {"severity": "ok", "subject": "uav1", "text": "quadrotor, PX4 1.17.0"},
            {"severity": "warning", "subject": "uav3", "text": "no battery failsafe"},
        ],
        "min_separation_m": 12.5,
        "inspection_speed_m_s": 5.0,
        "inspections": [
            {
                "segment": segment,
                "vehicle": name,
                "speed_mean_m_s": 5.0,
                "speed_max_m_s": 5.0 + 0.1 * segment,
                "deviation_mean_m": 0.0,
                "deviation_max_m": 0.25,
            }
            for name, flown in segments.items()
            for segment in flown
        ],
        "not_counted": [],
    }
