"""Pictures of pylons: which viewpoint they are of, and whether the vehicle's nose pointed there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from executor.core.context import Context
from executor.core.interface.messages import CameraStatus, PictureTaken
from executor.core.payload.camera_state import Picture, WantedPicture
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import PositionFix
from executor.core.state.vehicle_state import Stage, VehicleState, build_onboard_mission
from executor.core.telemetry.camera_reports import apply_payload_message
from executor.site import site_model
from missions import Phase, build_flight_path
from missions.cameras import PictureProof
from missions.inspection_height import build_first_paths
from tests.executor.builders import ground_for, site_of, with_facts
from tests.missions.builders import tall_line_east

NOW_S = 100.0
LOOK = {"camera": "rgb", "of": "pylons", "pylons": ["p1"], "bearings_deg": [60, 120], "distance_m": 14}
FIXED = {"name": "rgb", "id": 1}


def flying(*, low: bool, camera: Mapping[str, object] = FIXED, **look: object) -> tuple[Context, VehicleState]:
    """Return a vehicle that has flown around a pylon, in its layer or below it."""
    tables: dict[str, Any] = {"camera": [camera], "look": [{**LOOK, **look}], "inspection": {"same_distance": True}}
    site = site_of(("uav1", "uav2"), **tables)
    ground = ground_for(site, tall_line_east(3))
    context = site_model.build_context(ground, ground.setup, site_model.build_first_task(ground))
    path = (
        build_first_paths(ground.setup, {"uav1": (4,)})["uav1"]
        if low
        else build_flight_path(ground.setup, "uav1", (4,))
    )
    board = build_onboard_mission(context, "uav1", 0, path, (4,))
    last = max(index for index, point in enumerate(path.waypoints) if point.phase is Phase.INSPECT)
    return context, with_facts(VehicleState("uav1"), board=board, stage=Stage.FLYING, waypoint=last + 1)


def heard(
    context: Context, vehicle: VehicleState, known: FleetState | None = None, *, up_m: float, yaw_deg: float,
    word: bool = True, at_s: float = NOW_S, sequence: int = 0, point: int = 0,
) -> FleetState:  # fmt: skip
    """Return the state after a picture from over a viewpoint: a line due east, seen from the south."""
    place_m = context.setup.looks.pylons[2].points[point].place_m
    fix = PositionFix(at_s, at_s, place_m, up_m, up_m + 450.0, (0.0, 0.0, 0.0), yaw_deg)
    vehicle = replace(vehicle, motion=replace(vehicle.motion, fix=fix))
    state = (FleetState(vehicles={"uav1": vehicle}) if known is None else known).put(vehicle)
    message = PictureTaken(
        PictureProof.FEEDBACK, 1, 1, sequence, True, at_s, None, alt_rel_m=up_m, roll_deg=0.0, pitch_deg=0.0,
        yaw_deg=yaw_deg if word else None,
    )  # fmt: skip
    return apply_payload_message(context, state, state.vehicles["uav1"], message, at_s)


def taken(
    context: Context, vehicle: VehicleState, *, up_m: float, yaw_deg: float, word: bool = True
) -> tuple[Picture, ...]:
    """Return what is known of it."""
    return heard(context, vehicle, up_m=up_m, yaw_deg=yaw_deg, word=word).vehicles["uav1"].payload.pictures


@pytest.mark.parametrize("word", [True, False], ids=["by its camera", "by its position"])
@pytest.mark.parametrize(("beside_deg", "flaw"), [(0.0, ""), (-19.0, ""), (21.0, "aimed 21 degrees off target")])
def test_a_camera_on_the_nose_counts_where_that_points_at_the_region(beside_deg: float, flaw: str, word: bool) -> None:
    context, vehicle = flying(low=True, roi=True)
    to_pylon = context.setup.looks.pylons[2].points[0].yaw_deg
    [picture] = taken(context, vehicle, up_m=45.0, yaw_deg=to_pylon + beside_deg, word=word)
    assert (picture.points, picture.flaw) == ((0,), flaw)


def test_without_a_region_the_nose_may_point_anywhere() -> None:
    context, vehicle = flying(low=True)
    [picture] = taken(context, vehicle, up_m=45.0, yaw_deg=200.0)
    assert (picture.points, picture.flaw) == ((0,), "")


@pytest.mark.parametrize(("up_m", "points"), [(32.0, (0,)), (20.0, (1,)), (26.0, ()), (45.0, ())])
def test_a_viewpoint_is_known_by_its_height_too(up_m: float, points: tuple[int, ...]) -> None:
    context, vehicle = flying(low=True, heights_m=[2, -10])
    [picture] = taken(context, vehicle, up_m=up_m, yaw_deg=0.0)
    assert picture.points == points


def test_one_picture_from_the_layer_is_of_all_viewpoints_above_each_other() -> None:
    context, vehicle = flying(low=False, heights_m=[2, -10])
    state = heard(context, vehicle, up_m=45.0, yaw_deg=0.0)
    assert [one.points for one in state.vehicles["uav1"].payload.pictures] == [(0, 1)]
    assert state.coverage.caught[2] == (("rgb", 0.0), ("rgb", 1.0))


@pytest.mark.parametrize(("apart_s", "flaws"), [(4.0, ["taken again 4 s later", ""]), (30.0, ["", ""])])
@pytest.mark.parametrize("late", [False, True], ids=["in order", "the first one late"])
def test_of_two_pictures_of_a_stop_in_one_pass_the_last_counts(apart_s: float, flaws: list[str], late: bool) -> None:
    context, vehicle = flying(low=True)
    first = heard(context, vehicle, up_m=45.0, yaw_deg=0.0, at_s=NOW_S + (apart_s if late else 0.0), sequence=int(late))
    own = first.vehicles["uav1"]
    if late:  # it was passed over, and asked for again
        memory = replace(own.payload.camera_of("rgb", 1), wanted=(WantedPicture(0),))
        own = replace(own, payload=own.payload.with_camera(memory))
    both = heard(
        context, own, up_m=45.0, yaw_deg=0.0, at_s=NOW_S + (0.0 if late else apart_s), sequence=int(not late)
    ).vehicles["uav1"].payload.pictures  # fmt: skip
    assert [one.flaw for one in sorted(both, key=lambda one: one.at_s)] == flaws


@pytest.mark.parametrize(
    ("said", "known"), [([0.0], None), ([0.0, 120.0], 120.0), ([120.0, 0.0], 0.0), ([120.0, None], 120.0), ([], None)]
)
def test_a_card_that_never_had_room_is_not_known_to_be_full(said: list[float | None], known: float | None) -> None:
    context, vehicle = flying(low=True, camera={"name": "rgb", "id": 100})
    state = FleetState(vehicles={"uav1": vehicle})
    for free_mib in said:
        message = CameraStatus(100, films=False, images=0, free_mib=free_mib)
        state = apply_payload_message(context, state, state.vehicles["uav1"], message, NOW_S)
    assert state.vehicles["uav1"].payload.camera_of("rgb", 100).free_mib == known
