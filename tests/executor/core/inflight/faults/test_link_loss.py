"""Link loss: the ground station's, that of all vehicles, and that of one, each on both sides of its limit."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import pytest

from executor.core.inflight.faults.link_loss import check_all_links, check_link, discount_host_pause
from executor.core.interface.commands import Level, Say
from executor.core.state.fleet_state import FleetState, GroundStationAbsence
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import with_facts
from tests.executor.core.vehicles import CONTEXT, NOW_S, flying

NAMES = ("uav1", "uav2", "uav3")
BEGUN: dict[str, object] = {"launched_s": NOW_S - 500.0}


def heard(*ages_s: float | None, stages: tuple[Stage, ...] = (Stage.FLYING,) * 3, **changes: object) -> FleetState:
    """Return a flight whose vehicles were heard so long ago."""
    vehicles = {
        name: replace(
            flying(heard_s=None if age_s is None else NOW_S - age_s, spoke_s=None if age_s is None else NOW_S - age_s),
            name=name,
            stage=stage,
        )
        for name, age_s, stage in zip(NAMES, ages_s, stages, strict=False)
    }
    return with_facts(FleetState(MappingProxyType(vehicles)), **(BEGUN | changes))


def ages(state: FleetState) -> list[float]:
    return [NOW_S - one.link.heard_s for one in state.vehicles.values() if one.link.heard_s is not None]


@pytest.mark.parametrize(
    ("pause_s", "excused", "noted"), [(2.0, False, False), (2.1, True, False), (5.0, True, False), (5.1, True, True)]
)
def test_our_own_pause_is_no_fault_of_a_vehicle(pause_s: float, *, excused: bool, noted: bool) -> None:
    state, said = discount_host_pause(CONTEXT, heard(8.0, 8.0, 1.0, tick_s=NOW_S - pause_s), NOW_S)
    assert state.listening.tick_s == NOW_S
    rest_s = 8.0 - pause_s if excused else 8.0
    assert ages(state) == pytest.approx([rest_s, rest_s, 0.0 if excused else 1.0])
    assert {one.link.excused_s == NOW_S for one in state.vehicles.values()} == {excused}
    assert [(one.until_s, one.restarted, one.deaf) for one in state.listening.absences] == (
        [(NOW_S, False, False)] if noted else []
    )
    assert [one.pause_s for one in state.listening.absences] == pytest.approx([pause_s] if noted else [])
    assert [one.text for one in said if isinstance(one, Say)] == (
        [f"the ground station stalled for {pause_s:.1f} s"] if noted else []
    )


def test_the_first_tick_was_no_pause() -> None:
    state, said = discount_host_pause(CONTEXT, heard(8.0), NOW_S)
    assert (state.listening.tick_s, said, ages(state)) == (NOW_S, (), [8.0])


def test_a_vehicle_never_received_is_excused_from_nothing() -> None:
    state, _ = discount_host_pause(CONTEXT, heard(None, 8.0, tick_s=NOW_S - 4.0), NOW_S)
    assert state.vehicles["uav1"].link.heard_s is None


def fell_silent(state: FleetState, *, least: int = 1) -> list[str]:
    return [one.text for one in check_all_links(CONTEXT, state, NOW_S, least=least)[1] if isinstance(one, Say)]


IS_IT_OURS = ["all links lost: suspecting the ground radio; re-planning suspended"]


@pytest.mark.parametrize(
    ("state", "said"),
    [
        (heard(3.0, 9.0, 9.0), IS_IT_OURS),
        (heard(2.9, 9.0, 9.0), []),
        (heard(3.0, 9.0, 9.0, launched_s=None), []),
        # Who was switched off on the ground is not waited for, and one that sits there and speaks is heard.
        (heard(3.0, 9.0, 2.9, stages=(Stage.FLYING, Stage.FLYING, Stage.LANDED)), []),
        (heard(3.0, 9.0, 33.0, stages=(Stage.FLYING, Stage.FLYING, Stage.GROUND)), IS_IT_OURS),
        (heard(3.0, 33.0, stages=(Stage.FLYING, Stage.DOWN)), ["no link to any vehicle" + IS_IT_OURS[0][14:]]),
        (heard(3.0, 32.9, stages=(Stage.FLYING, Stage.DOWN)), IS_IT_OURS),
        # Who is lost already says nothing by its silence.
        (heard(3.0, 1.0, stages=(Stage.FLYING, Stage.LOST)), ["no link to any vehicle" + IS_IT_OURS[0][14:]]),
        (heard(9.0, 9.0, stages=(Stage.LANDED, Stage.DOWN)), []),
    ],
    ids=[str(number) for number in range(9)],
)
def test_all_fall_silent_at_once(state: FleetState, said: list[str]) -> None:
    assert fell_silent(state) == said


def test_it_lasts_since_the_last_one_was_heard() -> None:
    state, _ = check_all_links(CONTEXT, heard(4.0, 9.0, 5.0), NOW_S)
    assert state.listening.silent_since_s == NOW_S - 4.0


def test_of_fewer_than_asked_for_it_is_the_silence_of_each() -> None:
    assert fell_silent(heard(9.0), least=2) == []
    assert fell_silent(heard(9.0, 9.0), least=2) == IS_IT_OURS
    assert fell_silent(heard(9.0, 9.0, stages=(Stage.FLYING, Stage.LOST)), least=2) == []


@pytest.mark.parametrize(
    ("silent_s", "told_ago_s", "told"),
    [(59.9, None, False), (60.0, None, True), (400.0, 299.9, False), (400.0, 300.0, True)],
)
def test_a_silence_that_lasts_is_reported_again(silent_s: float, told_ago_s: float | None, *, told: bool) -> None:
    state = heard(
        silent_s,
        silent_s,
        silent_since_s=NOW_S - silent_s,
        silence_told_s=None if told_ago_s is None else NOW_S - told_ago_s,
    )
    after, said = check_all_links(CONTEXT, state, NOW_S)
    text = (
        f"no message from any vehicle for {silent_s:.0f} s; in the air at last contact: uav1, uav2. The "
        "flight stays open and resumes with the first link regained"
    )
    assert said == ((Say(Level.FAULT, text),) if told else ())
    assert after.listening.silence_told_s == (NOW_S if told else state.listening.silence_told_s)
    assert after.listening.silent_since_s == state.listening.silent_since_s


@pytest.mark.parametrize(("pause_s", "noted"), [(5.0, False), (5.5, True)])
def test_the_first_one_that_is_heard_excuses_the_others(pause_s: float, *, noted: bool) -> None:
    silent = heard(1.0, 1.0 + pause_s, silent_since_s=NOW_S - 1.0 - pause_s, silence_told_s=NOW_S - 2.0)
    state, said = check_all_links(CONTEXT, silent, NOW_S)
    assert said == (Say(Level.INFO, "links regained"),)
    assert (state.listening.silent_since_s, state.listening.silence_told_s) == (None, None)
    assert ages(state) == pytest.approx([0.0, 1.0]), "its time begins anew, and nobody is heard later than now"
    assert state.listening.absences == (
        (GroundStationAbsence(NOW_S, pause_s, restarted=False, deaf=True),) if noted else ()
    )


def test_the_flight_ends_once_no_vehicle_flies() -> None:
    parked = heard(9.0, 9.0, stages=(Stage.LANDED, Stage.GROUND), silent_since_s=NOW_S - 9.0)
    state, said = check_all_links(CONTEXT, parked, NOW_S)
    assert (state.listening.silent_since_s, said) == (None, ())


@pytest.mark.parametrize(("age_s", "falls"), [(2.9, False), (3.0, True)])
def test_one_falls_silent(age_s: float, *, falls: bool) -> None:
    before = heard(age_s, 0.0)
    state, said = check_link(CONTEXT, before, before.vehicles["uav1"], NOW_S)
    assert state.vehicles["uav1"].link.stale is falls
    assert said == ((Say(Level.WARNING, f"uav1: no message for {age_s:.1f} s"),) if falls else ())
    assert state.vehicles["uav1"].link.excused_s == before.vehicles["uav1"].link.excused_s


@pytest.mark.parametrize(("spoke_ago_s", "regained"), [(2.9, True), (3.0, False)])
def test_only_what_it_says_itself_is_a_link_regained(spoke_ago_s: float, *, regained: bool) -> None:
    silent = heard(0.0)
    vehicle = with_facts(silent.vehicles["uav1"], stale=True, spoke_s=NOW_S - spoke_ago_s)
    state, said = check_link(CONTEXT, silent, vehicle, NOW_S)
    assert said == ((Say(Level.INFO, "uav1: link regained"),) if regained else ())
    if regained:
        assert (state.vehicles["uav1"].link.stale, state.vehicles["uav1"].link.excused_s) == (False, NOW_S)


def test_a_vehicle_never_received_has_no_lost_link() -> None:
    before = heard(None)
    assert check_link(CONTEXT, before, before.vehicles["uav1"], NOW_S) == (before, ())
