"""Segments flown without the ground station: they count if clock, place, mode and battery agree."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from executor.core.battery import account
from executor.core.interface.messages import Heartbeat
from executor.core.resume.link_blackout import InferredCoverage, infer_coverage
from executor.core.state.inspection_proof import NOISE_M, InspectionRun, PositionSample, Track, advance_run, join_run
from executor.core.state.mission_ownership import MissionOwnership
from executor.core.state.vehicle_parts import LastKnown, ModeCause, PositionFix, Takeover
from executor.core.state.vehicle_state import Stage, VehicleState, last_known_of
from executor.core.vehicle_learning import LearnedFactors, PaceEstimate
from missions import Pace, Phase, dialect_for
from tests.executor.builders import fleet_of, vehicle
from tests.executor.core.vehicles import AUTO, CONTEXT, NOW_S, RTL, SETUP, at, flying, mission, pack

BOARD = mission()
LOITER = 5
WAYPOINTS, LEGS, PLACES_M = BOARD.path.waypoints, BOARD.legs, BOARD.places_m
VISITS = [index for index, point in enumerate(WAYPOINTS) if point.phase is Phase.INSPECT]
FIRST, SECOND = VISITS
LANDING = len(WAYPOINTS) - 1
BEGAN_S = 5000.0
RUN = join_run(BOARD.tracks[0], PositionSample(BEGAN_S, PLACES_M[FIRST - 1]), CONTEXT.inspection_speed_m_s)


def on_leg(waypoint: int, share: float, boot_s: float = BEGAN_S, beside_m: float = 0.0) -> PositionFix:
    """Return a position with so much of a leg behind it, flown to the east."""
    (east_a, north_a), (east_b, north_b) = PLACES_M[waypoint - 1], PLACES_M[waypoint]
    place_m = (east_a + share * (east_b - east_a), north_a + share * (north_b - north_a) + beside_m)
    return replace(at(), boot_s=boot_s, place_m=place_m, alt_rel_m=WAYPOINTS[waypoint].alt_rel_m)


def way_s(from_waypoint: int, from_share: float, to_waypoint: int, to_share: float) -> float:
    """Return how long a way along the mission takes."""
    between = sum(leg.duration_s for leg in LEGS[from_waypoint:to_waypoint])
    return between - from_share * LEGS[from_waypoint].duration_s + to_share * LEGS[to_waypoint].duration_s


def found(
    begin: tuple[int, float],
    end: tuple[int, float],
    late_s: float = 0.0,
    *,
    run: InspectionRun | None = RUN,
    **changes: object,
) -> InferredCoverage:
    """Return what counts of a way from one leg to another that took so much longer than it should."""
    run_visit = WAYPOINTS[begin[0]].visit if run is not None else None
    before = LastKnown(on_leg(*begin), begin[0], run, run_visit, 90.0)
    fix = on_leg(*end, BEGAN_S + way_s(*begin, *end) + late_s)
    state = flying(**({"before": before, "fix": fix, "waypoint": end[0]} | changes))
    return infer_coverage(CONTEXT, state, BOARD, state.assignment.waypoint)


WON_S = 100.0 / 3.0 - 100.0 / 3.9 - (math.sqrt(0.3**2 + 4.0 * 3.9) - math.sqrt(0.3**2 + 4.0 * 3.0))
"""By who flies 100 m just too fast for 3 m/s; its two ramps take a little longer for that."""
TRANSIT = (FIRST - 1, 0.5)
HOME = (SECOND + 1, 0.5)


def test_a_segment_between_two_places_of_the_mission_counts() -> None:
    assert found(TRANSIT, HOME) == InferredCoverage((0, 1))
    assert found((FIRST, 0.3), HOME) == InferredCoverage((0, 1))
    assert found((SECOND, 0.3), HOME) == InferredCoverage((1,))


def test_a_segment_with_a_rejected_beginning_does_not_count() -> None:
    assert found((FIRST, 0.3), HOME, run=None) == InferredCoverage((1,))


def test_the_one_under_way_is_joined_as_if_its_beginning_had_been_seen() -> None:
    under_way = found(TRANSIT, (SECOND, 0.5))
    assert (under_way.segments, under_way.joins, under_way.why_not) == ((0,), 1, "")
    # The rest of it, flown as it should be, makes it whole.
    track: Track = BOARD.tracks[1]
    run, flown, now_s = under_way.run, None, BEGAN_S + way_s(*TRANSIT, SECOND, 0.5)
    for metre in range(51):
        east_m = track.begin_m[0] + 50.0 + metre
        sample = PositionSample(now_s + metre / 3.0, (east_m, track.begin_m[1]), 3.0)
        told = advance_run(run, track, sample, corridor_m=CONTEXT.corridor_m, speed_m_s=CONTEXT.inspection_speed_m_s)
        run, flown = told.run, flown or told.flown
    assert flown is not None
    # Its first half is taken to have been flown at the speed that was asked for.
    assert flown.mean_m_s == pytest.approx(CONTEXT.inspection_speed_m_s, rel=1e-3)
    assert flown.deviation_max_m == pytest.approx(0.0, abs=1e-6)


def test_the_speed_that_it_is_found_at_is_that_over_ground() -> None:
    north = replace(on_leg(SECOND, 0.5, BEGAN_S + way_s(*TRANSIT, SECOND, 0.5)), velocity_m_s=(3.0, 4.0, 1.0))
    run = found(TRANSIT, (SECOND, 0.5), fix=north).run
    assert run is not None
    assert run.pace.fastest_m_s == 5.0


def test_nothing_happened_on_one_leg_of_the_way() -> None:
    assert found((FIRST, 0.2), (FIRST, 0.6), run=None) == InferredCoverage()
    assert found((SECOND + 1, 0.2), (SECOND + 1, 0.6)) == InferredCoverage()
    assert found(TRANSIT, HOME, before=None) == InferredCoverage()
    assert found(TRANSIT, HOME, fix=None) == InferredCoverage()


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_time_may_be_off_by_less_than_what_flying_a_segment_too_fast_wins(sign: float) -> None:
    assert found(TRANSIT, HOME, sign * (WON_S - 0.1)).segments == (0, 1)
    off = found(TRANSIT, HOME, sign * (WON_S + 0.1))
    way = way_s(*TRANSIT, *HOME)
    assert off == InferredCoverage(why_not=f"it took {way + sign * (WON_S + 0.1):.0f} s, expected {way:.0f} s")


def test_a_slow_vehicle_may_take_longer() -> None:
    pace = Pace(inspect=1.2, transit=1.1)
    slow = LearnedFactors(PaceEstimate(pace.inspect), PaceEstimate(pace.transit))
    ends = {TRANSIT[0]: 0.5, HOME[0]: 0.5}
    more_s = sum(
        ends.get(index, 1.0) * (pace.factor_of(WAYPOINTS[index].phase) - 1.0) * LEGS[index].duration_s
        for index in range(TRANSIT[0], HOME[0] + 1)
    )
    assert more_s > WON_S + 1.0
    assert found(TRANSIT, HOME, more_s, learned=slow).segments == (0, 1)
    assert found(TRANSIT, HOME, more_s).why_not
    assert found(TRANSIT, HOME, learned=slow).why_not


@pytest.mark.parametrize(("autopilot", "stop_s"), [("ardupilot", 1.0), ("px4", 3.25)])
def test_what_of_a_stop_is_over_no_place_tells(autopilot: str, stop_s: float) -> None:
    fleet = fleet_of(autopilot=autopilot)
    board = fleet.boards["uav1"]
    assert board is not None
    # No segment is long enough for its speed to tell.
    tracks = [replace(one, end_m=(one.begin_m[0] + 1.0, one.begin_m[1])) for one in board.tracks]
    board = replace(board, tracks=tuple(tracks))
    begins, legs = FIRST, board.legs
    before = LastKnown(
        PositionFix(NOW_S, BEGAN_S, board.places_m[begins], WAYPOINTS[begins].alt_rel_m, 0.0, (0.0, 0.0, 0.0)),
        begins, RUN, WAYPOINTS[begins].visit, 90.0,
    )  # fmt: skip
    # It has reached the end of its leg, and the whole stop is still to come.
    took_s = stop_s + sum(leg.duration_s for leg in legs[begins + 1 : HOME[0]]) + 0.5 * legs[HOME[0]].duration_s

    def counted(late_s: float) -> InferredCoverage:
        fix = on_leg(*HOME, BEGAN_S + took_s + late_s)
        heartbeat = Heartbeat(3, dialect_for(autopilot).modes.mission.custom_mode, True, 4)
        state = vehicle(
            fleet, stage=Stage.FLYING, before=before, fix=fix, waypoint=HOME[0], heartbeat=heartbeat, armed_once=True
        )
        return infer_coverage(fleet.context, state, board, HOME[0])

    assert counted(0.0).segments == (0, 1)
    assert counted(0.9).segments == (0, 1)
    assert counted(1.1).why_not


def test_a_clock_that_started_again_proves_nothing() -> None:
    way = way_s(*TRANSIT, *HOME)
    assert found(TRANSIT, HOME, -way).why_not == "its clock was reset"
    assert found(TRANSIT, HOME, -way + 0.1).why_not.startswith("it took 0 s")


def test_a_vehicle_elsewhere_proves_nothing() -> None:
    corridor_m, boot_s = CONTEXT.corridor_m, BEGAN_S + way_s(*TRANSIT, SECOND, 0.5)
    for beside_m in (corridor_m - 0.1, -corridor_m + 0.1):
        assert found(TRANSIT, (SECOND, 0.5), fix=on_leg(SECOND, 0.5, boot_s, beside_m)).joins == 1
    for beside_m in (corridor_m + 0.1, -corridor_m - 0.1):
        told = found(TRANSIT, (SECOND, 0.5), fix=on_leg(SECOND, 0.5, boot_s, beside_m))
        assert told == InferredCoverage(why_not=f"it is {corridor_m:.0f} m off its track")
    # Beyond the end of the leg it is as far away as that end is.
    beyond = on_leg(SECOND, 1.0 + (corridor_m + 3.0) / math.dist(PLACES_M[SECOND - 1], PLACES_M[SECOND]), boot_s)
    assert found(TRANSIT, (SECOND, 0.5), fix=beyond).why_not == f"it is {corridor_m + 3.0:.0f} m off its track"


@pytest.mark.parametrize("heartbeat", [None, Heartbeat(3, RTL, True, 4)])
def test_a_vehicle_no_longer_on_its_mission_proves_nothing(heartbeat: Heartbeat | None) -> None:
    told = found(TRANSIT, HOME, heartbeat=heartbeat)
    assert told.segments == ()
    assert told.why_not


def test_a_mission_that_went_back_proves_nothing() -> None:
    assert found((SECOND, 0.5), (SECOND, 0.9)).joins == 1
    back = found((SECOND, 0.5), (SECOND, 0.9), waypoint=FIRST)
    assert back == InferredCoverage(why_not="its mission went back")


TOUCHED: list[tuple[dict[str, Any], str]] = [
    ({"taken": Takeover(NOW_S)}, "it is under other control"),
    ({"cause": ModeCause.PERSON}, "it is under other control"),
    ({"carried": MissionOwnership(told_s=NOW_S)}, "it may carry another mission"),
    ({"carried": MissionOwnership(foreign_s=NOW_S)}, "it may carry another mission"),
    ({"jump": (50.0, NOW_S + 0.1)}, "its position jumped"),
]


@pytest.mark.parametrize(
    ("changes", "why_not"), [*TOUCHED, ({"mode_since_s": NOW_S + 0.1}, "its mode changed in the meantime")]
)
def test_any_other_event_during_the_gap_proves_nothing(changes: dict[str, Any], why_not: str) -> None:
    assert found(TRANSIT, HOME, **changes) == InferredCoverage(why_not=why_not)
    assert found(TRANSIT, HOME, mode_since_s=NOW_S, jump=(50.0, NOW_S)).segments == (0, 1), "that was before"


@pytest.mark.parametrize(("changes", "why_not"), TOUCHED)
def test_nor_does_one_that_has_landed(changes: dict[str, Any], why_not: str) -> None:
    assert landed(**changes) == InferredCoverage(why_not=why_not)


def test_in_one_segment_the_speed_between_two_places_is_known() -> None:
    """In a part of it less is won by flying too fast than what the whole of it lets a time be off.

    It is 30 m of 100 m, where neither its ramps nor its hold are.
    """
    way, fastest_s = way_s(FIRST, 0.3, FIRST, 0.6), (30.0 - NOISE_M) / 3.9
    assert found((FIRST, 0.3), (FIRST, 0.6), fastest_s + 0.1 - way).joins == 0
    early = found((FIRST, 0.3), (FIRST, 0.6), fastest_s - 0.1 - way)
    assert early.why_not.startswith("it took ")


def test_a_site_that_asks_for_proof_infers_nothing() -> None:
    proof = replace(CONTEXT, infers=False)
    before = LastKnown(on_leg(*TRANSIT), TRANSIT[0], None, None, 90.0)
    state = flying(before=before, fix=on_leg(*HOME, BEGAN_S + way_s(*TRANSIT, *HOME)), waypoint=HOME[0])
    assert infer_coverage(CONTEXT, state, BOARD, HOME[0]).segments == (0, 1)
    assert infer_coverage(proof, state, BOARD, HOME[0]) == InferredCoverage(
        why_not="the site requires proof by positions"
    )


DOWN = Heartbeat(3, AUTO, False, 3)


def landed(
    late_s: float = 0.0, used: float = 1.0, extra_pct: float = 0.0, factor: float = 1.0, **changes: object
) -> InferredCoverage:  # fmt: skip
    """Return what counts of a mission that was flown to its end unseen, for so much of what it should have cost."""
    begin = (FIRST, 0.5)
    before = LastKnown(on_leg(*begin), FIRST, RUN, WAYPOINTS[FIRST].visit, 90.0, factor=factor)
    rest_s = way_s(*begin, LANDING, 1.0)
    rest_pct = 0.5 * LEGS[FIRST].energy_pct + sum(leg.energy_pct for leg in LEGS[FIRST + 1 :])
    known = pack(90.0 - used * rest_pct - extra_pct)
    fix = replace(at(), boot_s=BEGAN_S + rest_s + late_s, place_m=SETUP.pad_m, alt_rel_m=0.0)
    told: dict[str, object] = {"before": before, "fix": fix, "battery": known, "heartbeat": DOWN, "waypoint": 0}
    state: VehicleState = flying(**(told | changes))
    return infer_coverage(CONTEXT, state, BOARD, state.assignment.waypoint)


def test_a_vehicle_back_on_its_pad_has_flown_its_mission() -> None:
    assert landed() == InferredCoverage((0, 1))
    assert landed(late_s=600.0) == InferredCoverage((0, 1)), "when it landed nobody knows"


def test_a_vehicle_that_landed_too_soon_has_not() -> None:
    assert landed(late_s=-WON_S + 0.1).segments == (0, 1)
    assert "too short for its leg" in landed(late_s=-WON_S - 0.1).why_not


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_what_it_used_tells_how_far_it_flew(sign: float) -> None:
    assert landed(extra_pct=sign * 1.95).segments == (0, 1)
    assert " %, expected " in landed(extra_pct=sign * 2.05).why_not
    assert landed(before=None) == InferredCoverage()


def test_what_was_used_in_the_gap_does_not_judge_itself() -> None:
    """Positions and heartbeats of the ground come together: the model may take the whole gap for a flight."""
    thirsty = landed(used=2.0, factor=2.0)
    assert thirsty == InferredCoverage((0, 1))
    assert landed(used=2.0).why_not, "a vehicle that was not known to use as much"
    after = pack(90.0)
    estimate = after.estimate
    assert estimate is not None
    rest_pct = 0.5 * LEGS[FIRST].energy_pct + sum(leg.energy_pct for leg in LEGS[FIRST + 1 :])
    for factor in (0.7, 1.0, 2.0):
        known = replace(after, remaining_pct=90.0 - rest_pct, estimate=replace(estimate, factor=factor))
        assert landed(battery=known) == InferredCoverage((0, 1)), factor
        known = replace(known, remaining_pct=90.0 - 2.0 * rest_pct)
        assert landed(battery=known).why_not, factor


def test_what_is_known_of_a_vehicle_goes_with_it_into_a_gap() -> None:
    battery = pack(90.0, 90.0)
    assert battery.estimate is not None
    known = flying(battery=replace(battery, estimate=replace(battery.estimate, factor=1.3)), stage=Stage.FLYING)
    before = last_known_of(known)
    assert before is not None
    assert before.factor == 1.3


def test_a_vehicle_off_its_pad_or_returned_by_failsafe_proves_nothing() -> None:
    pad_e, pad_n = SETUP.pad_m
    fix = replace(at(), boot_s=BEGAN_S + 900.0, alt_rel_m=0.0)
    assert landed(fix=replace(fix, place_m=(pad_e + 15.0, pad_n))).segments == (0, 1)
    assert landed(fix=replace(fix, place_m=(pad_e + 15.1, pad_n))).why_not == "it is not on its pad"
    assert landed(heartbeat=Heartbeat(3, RTL, False, 3)).why_not == "it returned without a command"
    assert landed(heartbeat=Heartbeat(3, LOITER, False, 3)).why_not == "its pilot may have landed it"
    assert landed(battery=account.BatteryState()).why_not == "its consumption is not known"


def test_a_vehicle_that_was_not_started_yet_has_flown_nothing() -> None:
    """It says where it is after a while, as the start that waited for that would begin."""
    assert landed(start_owed_s=5.0) == InferredCoverage()
    assert landed().segments == (0, 1)


def test_a_vehicle_in_its_climb_has_the_rest_of_it_ahead() -> None:
    climb_m = WAYPOINTS[0].alt_rel_m
    assert WAYPOINTS[0].phase is Phase.TAKEOFF
    for share in (0.0, 0.5, 1.0):
        low = replace(at(), boot_s=BEGAN_S, place_m=PLACES_M[0], alt_rel_m=share * climb_m)
        way = (1.0 - share) * LEGS[0].duration_s + way_s(1, 0.0, *HOME)
        before = LastKnown(low, 0, None, None, 90.0)
        for late_s, counts in ((WON_S - 0.1, True), (WON_S + 0.1, False)):
            for sign in (-1.0, 1.0):
                fix = on_leg(*HOME, BEGAN_S + way + sign * late_s)
                told = found(TRANSIT, HOME, before=before, fix=fix)
                assert (told.segments == (0, 1)) is counts, (share, sign * late_s)
