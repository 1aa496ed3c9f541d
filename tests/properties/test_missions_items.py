"""Items: through QGroundControl's formats and back, and through what autopilots store and back."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from missions import (
    ARDUPILOT,
    PX4,
    Command,
    Dialect,
    EncodedMission,
    FlightPath,
    MissionItem,
    Phase,
    Waypoint,
    encode,
    find_mission_differences,
)
from missions.exports import format_qgc_plan, format_qgc_waypoints
from tests.missions.qgc_files import read_qgc_plan, read_waypoints

HOME = (49.6, 15.6, 450.0)


@st.composite
def paths(draw: st.DrawFn) -> FlightPath:
    """Draw any path that starts with a take-off."""
    places = st.tuples(st.floats(-85, 85), st.floats(-180, 179.9), st.floats(-500, 5000), st.floats(0.1, 20))
    phases = st.sampled_from([Phase.TRANSIT, Phase.INSPECT, Phase.RETURN, Phase.LAND])
    first = draw(places)
    points = [Waypoint(Phase.TAKEOFF, *first)]
    for phase, place, hold in draw(st.lists(st.tuples(phases, places, st.booleans()), max_size=12)):
        points.append(Waypoint(phase, *place, hold=hold))
    return FlightPath("uav1", tuple(points))


def missions_of(dialect: Dialect) -> st.SearchStrategy[EncodedMission]:
    return paths().map(lambda path: encode(path, dialect))


both = pytest.mark.parametrize("dialect", [ARDUPILOT, PX4])


@both
@settings(derandomize=True, deadline=None, max_examples=60)
@given(data=st.data())
def test_items_survive_a_plan_file(dialect: Dialect, data: st.DataObject) -> None:
    items = data.draw(missions_of(dialect)).items
    written, home = read_qgc_plan(format_qgc_plan(items, dialect, HOME))
    flown = items[1:] if dialect.home_item else items
    renumbered = [replace(item, seq=seq) for seq, item in enumerate(flown)]
    # Exactly, but for the frame's second number and the flag, which a .plan does not have.
    assert find_mission_differences(renumbered, written, PX4) == ()
    assert home == HOME


HEADINGS = st.integers(0, 359).map(float)


@both
@settings(derandomize=True, deadline=None, max_examples=60)
@given(data=st.data())
def test_items_survive_a_waypoints_file(dialect: Dialect, data: st.DataObject) -> None:
    # Headings that are left open have no word in this format, which PX4 leaves everywhere.
    items = tuple(replace(item, param4=data.draw(HEADINGS)) for item in data.draw(missions_of(dialect)).items)
    again = read_waypoints(format_qgc_waypoints(items, dialect, HOME))
    assert find_mission_differences(items, again, dialect) == ()
    assert [item.current for item in again] == [item.current for item in items]


def stored(item: MissionItem, dialect: Dialect) -> MissionItem:
    """Return what comes back from an autopilot that keeps float32 and, for ArduPilot, centimetres."""
    z = float(np.float32(item.z))
    if dialect is ARDUPILOT:
        z = math.trunc(float(np.float32(item.z) * np.float32(100.0))) / 100.0
        if item.seq == 0:
            return replace(item, x=1, y=2, z=3.0)
        if item.command == Command.NAV_LAND:
            return replace(item, param4=1.0, z=z)
    return replace(item, param2=float(np.float32(item.param2)), z=z, current=False)


@both
@settings(derandomize=True, deadline=None, max_examples=60)
@given(data=st.data())
def test_what_is_stored_faithfully_is_no_difference(dialect: Dialect, data: st.DataObject) -> None:
    items = data.draw(missions_of(dialect)).items
    assert find_mission_differences(items, [stored(item, dialect) for item in items], dialect) == ()


@both
@settings(derandomize=True, deadline=None, max_examples=60)
@given(data=st.data())
def test_any_moved_place_is_a_difference(dialect: Dialect, data: st.DataObject) -> None:
    items = data.draw(missions_of(dialect)).items
    seq = data.draw(st.integers(1 if dialect.home_item else 0, len(items) - 1))
    key = data.draw(st.sampled_from(["x", "y"]))
    by = data.draw(st.integers(2, 10**6)) * data.draw(st.sampled_from([-1, 1]))
    read_back = list(items)
    read_back[seq] = replace(items[seq], **{key: getattr(items[seq], key) + by})
    (text,) = find_mission_differences(items, read_back, dialect)
    assert f"item {seq} " in text
    assert f": {key} sent" in text
