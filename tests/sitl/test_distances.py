"""All vehicles at the requested distance, on real autopilots: at a shared pylon one descends after the other."""

from __future__ import annotations

import itertools
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path

import pytest

from benchmarks.prediction import plan_with
from executor.site import site_model
from executor.site.site_file import check_site
from executor.site.site_model import SiteModel
from missions.geometry import locate_on_leg
from missions.inspection_height import build_first_paths, segment_distances_m
from tests.e2e.tlog import messages
from tests.sitl.flights import NAMES, Flown, Prepared, Story, flown
from tests.sitl.real import BOTH, SOON_HOME, Autopilot

ASKED_M, LAYER_M = 15.0, 5.0
OFF_M = 1.5
"""What a real vehicle's height may be off, by its own word."""
ROUTES = {"uav1": (12, 2, 4), "uav2": (8, 10, 6), "uav3": (1,)}
"""uav2's last segment, V104.1, ends at the pylon where uav1's first, V104B.1, begins."""
FIRST = {"uav1": (2, 4, 12), "uav2": (6, 8, 10), "uav3": (1,)}
"""The same, with V104.1 the first of uav2's, so that nobody has left it yet."""
SHARED = 3


def shared(ground: SiteModel, routes: Mapping[str, tuple[int, ...]]) -> Prepared:
    """Return the plan in which two share a pylon, of which one has to stay in its layer there at first."""
    at_m = {
        name: segment_distances_m(ground.setup, path, routes[name])
        for name, path in build_first_paths(ground.setup, routes).items()
    }
    assert at_m["uav2"][SHARED] > ASKED_M
    return Prepared(ground, plan_with(ground, routes), math.inf)


def places_m(done: Flown, ground: SiteModel, name: str) -> list[tuple[float, float, float, float]]:
    """Return a vehicle's time, east, north and height over the depot's ground, by its own positions."""
    frame = ground.network.frame
    return [
        (stamp_s, *frame.to_local_m(one.lat / 1e7, one.lon / 1e7), frame.up_m(one.alt / 1e3))
        for stamp_s, one in messages(done.run / f"{name}.tlog", "GLOBAL_POSITION_INT")
        if one.get_srcComponent() == 1
    ]


def all_as_asked(autopilot: Autopilot, tmp_path: Path, routes: Mapping[str, tuple[int, ...]], by: str) -> Flown:
    """Fly it, and hold who inspected the shared segment at last, and how near anybody came, against their positions."""
    # Who would not come home by itself when it hears nobody stays in its layer.
    story = Story(
        settings=SOON_HOME[autopilot], tables={"inspection": {"same_distance": True}},
        prepared=lambda ground: shared(ground, routes),
    )  # fmt: skip
    done = flown(autopilot, story, tmp_path)
    assert done.report["finished"], done.said
    assert {row["inspected_at_m"] for row in done.report["inspections"]} == {ASKED_M}, done.said
    assert done.report["replans"] == []
    ground = site_model.load_site_model(
        check_site(tomllib.loads((done.run / "site.toml").read_text()), "test"), done.run
    )
    own = {name: places_m(done, ground, name) for name in NAMES}
    begin_m, end_m = (tuple(end) for end in ground.setup.tracks_m[SHARED].tolist())
    over_m = [
        up_m - ground.setup.layers.surface.height_m(east_m, north_m) + ASKED_M
        for _, east_m, north_m, up_m in own[by]
        if (along := locate_on_leg(begin_m, end_m, (east_m, north_m)))[1] < 3.0
        and 0.2 < along[0] / math.dist(begin_m, end_m) < 0.8
    ]
    assert over_m
    assert max(abs(at_m - ASKED_M) for at_m in over_m) < OFF_M, over_m
    for one, other in itertools.combinations(NAMES, 2):
        at = {round(place[0]): place[1:] for place in own[other]}
        assert all(math.dist(place[1:], at[now]) > LAYER_M for place in own[one] if (now := round(place[0])) in at
                   and place[3] > ASKED_M)  # fmt: skip
    return done


@pytest.mark.sitl
@pytest.mark.timeout(580)
@BOTH
def test_vehicles_at_a_shared_pylon_descend_once_the_other_has_left(autopilot: Autopilot, tmp_path: Path) -> None:
    done = all_as_asked(autopilot, tmp_path, ROUTES, "uav2")
    assert "uav2: airspace at V104.1 is free; new mission at inspection height" in done.said


@pytest.mark.sitl
@pytest.mark.timeout(580)
@BOTH
def test_what_counts_from_a_layer_is_flown_again_before_the_return(autopilot: Autopilot, tmp_path: Path) -> None:
    done = all_as_asked(autopilot, tmp_path, FIRST, "uav1")
    assert "uav1: re-inspects V104.1 at inspection height; new mission before it returns" in done.said
    by = {row["segment"]: row["vehicle"] for row in done.report["inspections"]}
    assert by[SHARED] == "uav1"
