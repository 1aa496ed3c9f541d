"""Re-inspection of named assets: which are opened, and which are refused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import pytest

from executor.adapters.eventlog import from_plain, to_plain
from executor.core import fleet_step
from executor.core.context import Context
from executor.core.imaging.asset_status import find_missed_segments
from executor.core.interface.commands import Level, Say, Solve
from executor.core.interface.events import IntentReceived, Tick
from executor.core.interface.intents import Action, Intent, IntentReason, Outcome
from executor.core.operator import intent_refusals
from executor.core.payload.camera_state import AwaitedPictures
from executor.core.state.fleet_state import FleetState
from missions import Segment
from missions.cameras import Camera, CameraTasks, PylonCameraTask, SpanCameraTask, Trigger, Viewpoint
from missions.no_fly_areas import Unreachable
from tests.executor.core.steps import flight_of, plan_of
from tests.executor.core.vehicles import FLEET, NOW_S, flying

SPAN = (SpanCameraTask("rgb", Trigger.DISTANCE, 10.0),)
NAMES = {0: "V1-3", 1: "V1-4", 2: "pylon 9", 3: "pylon 9", 4: "V2-1"}
EVERYBODY = frozenset({"rgb"})


def sighted(carriers: Mapping[str, frozenset[str]] | None = None, **facts: Any) -> Context:
    """Return a site that asks for pictures of all but its last span; two assets share a name."""
    network = FLEET.context.setup.network
    segments = tuple(Segment(one.id, one.a, one.b, NAMES.get(one.id, "")) for one in network.segments)
    around = PylonCameraTask("rgb", (Viewpoint((0.0, 0.0), 0, 0), Viewpoint((9.0, 0.0), 0, 0)), 1.0, 20.0)
    spans = {number: SPAN for number in range(len(segments) - 1) if number != 2}
    carried = dict.fromkeys(FLEET.boards, EVERYBODY) if carriers is None else dict(carriers)
    looks = CameraTasks({"rgb": Camera("rgb", 100)}, carried, spans, {2: around})
    setup = replace(FLEET.context.setup, network=replace(network, segments=segments), looks=looks)
    return replace(FLEET.context, setup=setup, **facts)


SITE = sighted()
SEEN = {
    "inspected": MappingProxyType({0: "uav1", 1: "uav1", 2: "uav2", 5: "uav3"}),
    "caught": MappingProxyType({0: (("rgb", 5.0),), 1: (("rgb", 5.0),), 2: (("rgb", 0.0), ("rgb", 1.0))}),
}


def asked(*assets: int | str, action: Action = Action.PROVE) -> Intent:
    return Intent("wish", action, None, "page", assets=assets)


def refused(state: FleetState, *assets: int | str, context: Context = SITE) -> tuple[IntentReason, str] | None:
    return intent_refusals.find_refusal(context, state, asked(*assets), NOW_S)


def stepped(state: FleetState, *assets: int | str, context: Context = SITE) -> tuple[FleetState, list[object]]:
    after, commands = fleet_step.step(context, state, IntentReceived(asked(*assets)), NOW_S)
    return after, list(commands)


@pytest.mark.parametrize("asset", ["V2-1", 4])
def test_one_that_counts_as_seen_is_open_again_and_planned(asset: int | str) -> None:
    state = flight_of(
        flying(), inspected=MappingProxyType(dict.fromkeys((2, 3, 4, 5), "uav2")), caught=MappingProxyType({4: ()})
    )
    after, told = stepped(state, asset)
    assert told == [Say(Level.INFO, "page asks: prove of 1 asset; V2-1 reopened for re-inspection")]
    assert set(after.coverage.inspected) == {2, 3, 5}
    assert dict(after.coverage.caught) == {}
    assert find_missed_segments(SITE, after) == frozenset()
    record = after.crew.intents["wish"]
    assert (record.outcome, record.intent.assets) == (Outcome.ACCEPTED, (asset,))
    _, commands = fleet_step.step(SITE, after, Tick(), NOW_S)
    [solve] = [one for one in commands if isinstance(one, Solve)]
    assert (solve.open_segments, solve.trigger) == ((1, 4), "re-inspection of V2-1 requested by page")


def test_a_name_stands_for_all_that_carry_it_and_are_not_open() -> None:
    after, told = stepped(flight_of(flying(), **SEEN), "pylon 9", 5)
    assert told == [Say(Level.INFO, "page asks: prove of 2 assets; pylon 9, segment 5 reopened for re-inspection")]
    assert dict(after.coverage.inspected) == {0: "uav1", 1: "uav1"}


def test_an_asset_waiting_for_pictures_or_given_up_gets_new_tries() -> None:
    state = flight_of(
        flying(),
        given_up=frozenset({3}),
        attempts=MappingProxyType({3: 3, 4: 1}),
        unseen=MappingProxyType({4: AwaitedPictures("uav1", NOW_S - 1.0)}),
        not_seen=MappingProxyType({3: "uav1"}),
    )
    after, _ = stepped(state, 3, 4)
    assert (after.coverage.given_up, dict(after.coverage.unseen)) == (frozenset(), {})
    assert dict(after.coverage.attempts) == {}
    assert find_missed_segments(SITE, after) == {3}  # it was flown and is not seen, until it is


def test_what_was_missed_once_and_seen_later_is_not_missed_again() -> None:
    gone = MappingProxyType({0: "uav1", 4: "uav1"})
    after, _ = stepped(flight_of(flying(), **SEEN, not_seen=gone), 0)
    assert find_missed_segments(SITE, after) == {4}


def test_what_is_refused_has_a_code_and_changes_nothing() -> None:
    state = flight_of(flying(), **SEEN)
    lost = Unreachable(4, "lies in area 'airfield'")
    part = sighted(wanted=frozenset({0, 1}), unreachable=(lost,))
    nobody = sighted(carriers={})
    rows: list[tuple[object, IntentReason, str]] = [
        (refused(state, "V9-9"), IntentReason.ASSET_UNKNOWN, "there is no asset 'V9-9': expected its name as the page"),
        (refused(state, 6), IntentReason.ASSET_UNKNOWN, "there is no segment 6: expected 0 to 5"),
        (refused(state, "V1-3", 99), IntentReason.ASSET_UNKNOWN, "there is no segment 99: expected 0 to 5"),
        (refused(state, 4), IntentReason.ASSET_OPEN, "V2-1 is open already"),
        (refused(state, 3), IntentReason.ASSET_OPEN, "pylon 9 is open already"),
        (
            refused(state, "V1-3", context=nobody),
            IntentReason.ASSET_NEVER_FLOWN,
            "V1-3 is never flown: no vehicle has a camera rgb that works",
        ),
        (
            refused(state, 4, context=part),
            IntentReason.ASSET_NEVER_FLOWN,
            "V2-1 is never flown: it lies in area 'airfield'",
        ),
        (
            refused(state, 5, context=part),
            IntentReason.ASSET_NEVER_FLOWN,
            "segment 5 is never flown: it is no part of this flight",
        ),
        (
            refused(flight_of(flying(), **SEEN, replan=plan_of()), 0),
            IntentReason.REPLANNING,
            "a re-plan is under way",
        ),
        (
            refused(flight_of(flying(held_s=5.0), **SEEN), 0),
            IntentReason.NO_VEHICLE,
            "no vehicle can take a new route now",
        ),
        (refused(flight_of(flying(), **SEEN, launched_s=None), 0), IntentReason.NOT_BEGUN, "the flight has not begun"),
    ]  # fmt: skip
    for found, code, words in rows:
        assert isinstance(found, tuple), words
        assert (found[0], found[1][: len(words)]) == (code, words)

    after, _ = stepped(state, "V1-3", 4)
    assert after.coverage is state.coverage


def test_a_camera_that_works_on_one_vehicle_is_enough() -> None:
    seeing = sighted(carriers={"uav2": EVERYBODY})
    assert refused(flight_of(flying(), **SEEN), 0, context=seeing) is None


def test_the_log_keeps_which_they_are() -> None:
    event = IntentReceived(asked("pylon 9", 17))
    assert from_plain(to_plain(event)) == event
    older = to_plain(event)
    assert isinstance(older, dict)
    del older["intent"]["assets"]
    assert from_plain(older).intent.assets == ()
