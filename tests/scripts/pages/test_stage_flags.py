"""The machine of a vehicle: its stage changes by the table alone, and no flag is set where the table forbids it."""

from __future__ import annotations

import ast
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import executor.core
from executor.core.interface.commands import Start
from executor.core.interface.intents import FOR_ALL, Action, Outcome
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import HomingOrder, Takeover
from executor.core.state.vehicle_state import TRANSITIONS, Stage, VehicleState, change_stage
from scripts.pages.stage_flags import EVERYWHERE, FLAGS, find_flag_breaches
from tests.executor.builders import THREE, fleet_of, with_facts
from tests.executor.core.steps import BATTERY_FAULT
from tests.executor.core.stories import FLEET, story
from tests.executor.core.vehicles import NOW_S, flying
from tests.fakes.flight import Story

CORE = Path(executor.core.__path__[0])
SET: dict[str, dict[str, object]] = {
    "fault": {"fault": BATTERY_FAULT},
    "taken": {"taken": Takeover(NOW_S)},
    "errand": {"errand": HomingOrder(NOW_S)},
    "held": {"held_s": NOW_S},
    "lands": {"lands": True},
    "excluded": {"excluded": True},
    "cleared": {"cleared_s": NOW_S},
    "pending": {"pending": 1},
    "stubborn": {"stubborn": True},
    "owed": {"owed": (0, "why")},
}
MODES = {"loiter": 5, "return": 6, "land": 9, "mission": 3}
TROUBLE = st.tuples(
    st.floats(0.4, 40.0), st.sampled_from(tuple(THREE)), st.sampled_from([*Action, *MODES, "mute", "heard", "stuck"])
)


def stage_setters(path: Path) -> list[int]:
    """Return the lines that give a stage to a changed copy of something."""
    calls = [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)]
    named = [call for call in calls if isinstance(call.func, ast.Name) and call.func.id == "replace"]
    return [call.lineno for call in named if any(keyword.arg == "stage" for keyword in call.keywords)]


def test_nothing_but_the_table_gives_a_vehicle_another_stage() -> None:
    """One of the two is `change_stage`, the other what is only supposed."""
    found = {path.name: lines for path in CORE.rglob("*.py") if (lines := stage_setters(path))}
    assert {name: len(lines) for name, lines in found.items()} == {"vehicle_state.py": 2}


@pytest.mark.parametrize("stage", Stage)
def test_a_stage_follows_by_the_table(stage: Stage) -> None:
    for other in set(Stage) - {stage}:
        if other in TRANSITIONS[stage]:
            assert change_stage(flying(stage=stage), other) == flying(stage=other)
        else:
            with pytest.raises(ValueError, match=f"uav1: {stage.value} cannot become {other.value}"):
                change_stage(flying(stage=stage), other)


@pytest.mark.parametrize("rule", FLAGS, ids=lambda rule: rule.name)
def test_a_flag_is_seen_where_it_must_not_be(rule: Any) -> None:
    for stage in Stage:
        calm = flying(stage=stage)
        said = [f"uav1: {rule.name} while {stage.value}"] if stage not in rule.stages else []
        assert list(find_flag_breaches(calm, with_facts(calm, **SET[rule.name]))) == said
        assert list(find_flag_breaches(calm, calm)) == []


def test_every_flag_is_in_the_table_once_and_somewhere() -> None:
    assert [rule.name for rule in FLAGS] == list(SET)
    assert all(rule.stages and rule.stages <= EVERYWHERE for rule in FLAGS)


def test_a_change_that_the_table_does_not_know_is_seen() -> None:
    assert list(find_flag_breaches(flying(stage=Stage.LOST), flying())) == ["uav1: lost became flying"]


def befall(flight: Story, name: str, what: Action | str) -> None:
    """Let an operator ask for something, a pilot move a switch, or something break."""
    craft = flight.crafts[name]
    if isinstance(what, Action):
        flight.ask(what, None if what in FOR_ALL else name, confirmed=True)
    elif what in MODES:
        craft.go_to(MODES[what])
    else:
        craft.mute, craft.stuck = what == "mute", what == "stuck"


@given(trouble=st.lists(TROUBLE, min_size=1, max_size=10))
@settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
def test_whatever_befalls_a_flight_keeps_to_the_tables(trouble: list[tuple[float, str, Action | str]]) -> None:
    """`Story` holds every step to them."""
    flight = story(FLEET)
    for after_s, name, what in trouble:
        if not flight.over:
            flight.pass_s(after_s)
        if not flight.over:
            befall(flight, name, what)
    if not flight.over:
        flight.pass_s(60.0)
    assert set(flight.state.vehicles) == set(THREE)


def test_a_vehicle_excluded_during_its_upload_does_not_start() -> None:
    """It was told that it stays on the ground: somebody may stand at its pad."""
    flight = story(fleet_of({"uav1": (0, 2, 4), "uav2": (6, 8), "uav3": ()}))
    flight.pass_s(40.0)
    flight.crafts["uav1"].mute = True
    flight.run(lambda: flight.vehicle("uav3").assignment.pending is not None)
    flight.ask(Action.EXCLUDE, "uav3")
    flight.pass_s(60.0)
    assert flight.vehicle("uav3").stage is Stage.GROUND
    assert Start("uav3") not in [command for _, command in flight.commands]


@pytest.mark.parametrize("out", [{"fault": BATTERY_FAULT}, {"excluded": True}])
def test_a_vehicle_out_of_the_plan_is_not_included_for_a_hold(out: dict[str, object]) -> None:
    """From a hold it would be sent on, on a mission that others fly."""
    flight = story()
    flight.pass_s(30.0)
    theirs = with_facts(flight.vehicle("uav1"), stage=Stage.PILOT, taken=Takeover(flight.now_s, given_away=True), **out)
    flight.state = flight.state.put(theirs)
    flight.ask(Action.HOLD, "uav1", "hold", confirmed=True)
    record = flight.state.crew.intents["hold"]
    assert (record.outcome, record.text) == (
        Outcome.REFUSED, "it is out of the plan; return or land it",
    )  # fmt: skip
    assert flight.vehicle("uav1").stage is Stage.PILOT


def test_put_replaces_one_vehicle_and_keeps_the_rest() -> None:
    """It names every field itself: one that is new must not be forgotten."""
    parts: dict[str, Any] = {one.name: object() for one in fields(FleetState)} | {"vehicles": {}}
    vehicle, fleet = VehicleState("uav1"), FleetState(**parts)
    assert fleet.put(vehicle) == replace(fleet, vehicles={vehicle.name: vehicle})
