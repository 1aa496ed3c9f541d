"""Sites with areas and named places, from the command line to the plan file and the run directory."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from executor.adapters.run_directory import RunDirectory
from executor.analysis.flight_record import build_launch_revision
from executor.analysis.pictures.map_figures import draw_plan_figure
from executor.flight.next_flight import plan_next_flight
from executor.flight.run_start import FlightRequest, write_run_start
from executor.site import site_model, site_planning
from executor.site.site_file import read_site
from missions import PlanFileError, read_plan, write_plan
from missions.geo import LocalFrame
from missions.plan_file import setup_of_plan
from missions.readers import read_network
from tests.executor.cli.test_main import DEPOT, Place, place
from tests.executor.flights import short_report

__all__ = ["place"]

FRAME = LocalFrame(*DEPOT)


def corners(*places_m: tuple[float, float]) -> str:
    """Return places in metres about the depot as the site file has them."""
    return json.dumps([FRAME.to_wgs84_deg(*one) for one in places_m])


def box(west: float, south: float, east: float, north: float) -> str:
    return corners((west, south), (east, south), (east, north), (west, north))


def area(**keys: object) -> str:
    """Return a table of the site file."""
    rows = (f"{key} = {value if key in RAW else json.dumps(value)}" for key, value in keys.items())
    return "\n".join(("[[area]]", *rows)) + "\n"


RAW = ("polygon", "line")
SHED = area(name="shed", polygon=box(130, -40, 175, 40))
"""On the second of four segments, of which each is 60 m long and the first begins 60 m east of the depot."""


def test_what_lies_in_an_area_is_named_and_not_planned(place: Place) -> None:
    place.site(extra=SHED)
    code, out, _ = place.run("plan", place.path("site.toml"), "--seconds", "0.2", "-o", place.path("plan.json"))
    assert code == 1
    assert "2 of 4 segments" in out
    assert "not reachable, lies in area 'shed': " in out
    content = read_plan(place.path("plan.json"))
    assert [segment.id for segment in content.segments] == [0, 3]
    assert [(one.segment, one.why) for one in content.unreachable] == [
        (1, "lies in area 'shed'"),
        (2, "lies nearer than 10 m to area 'shed'"),
    ]
    assert place.run("check", place.path("plan.json"))[0] == 0


def test_a_plan_file_carries_its_areas_and_is_checked_against_them(place: Place) -> None:
    place.site(
        extra=area(name="pond", polygon=box(70, 20, 290, 60)) + area(name="yard", polygon=box(70, -60, 110, -20))
    )
    plan = place.planned(extra=area(name="pond", polygon=box(70, 20, 290, 60)))
    document = json.loads(Path(plan).read_text())
    [kept_out] = document["model"]["kept_out"]
    written = kept_out["area"]
    assert (written["name"], written["kind"], kept_out["vehicles"]) == ("pond", "no-fly", ["uav1", "uav2"])
    assert "unreachable" not in document
    written["rings_m"][0] = [[70.0, -30.0], [290.0, -30.0], [290.0, 60.0], [70.0, 60.0]]
    Path(plan).write_text(json.dumps(document))
    code, out, _ = place.run("check", plan)
    assert code == 1
    assert "is flown, and lies in area 'pond'" in out


def test_a_plan_of_other_areas_is_not_flown(place: Place) -> None:
    plan = read_plan(place.planned(extra=area(name="pond", polygon=box(70, 30, 290, 60))))

    def ground(extra: str) -> site_model.SiteModel:
        place.site(extra=extra)
        return site_model.load_site_model(read_site(place.folder / "site.toml"), place.folder)

    site_planning.check_plan_fits(plan, ground(area(name="pond", polygon=box(70, 30, 290, 60))), "plan.json")
    with pytest.raises(PlanFileError, match=r"changed: area\[0\].margin_m is 15, the plan was made with 10"):
        site_planning.check_plan_fits(
            plan, ground(area(name="pond", polygon=box(70, 30, 290, 60), margin_m=15)), "plan.json"
        )
    with pytest.raises(PlanFileError, match="the site has changed: areas is 0, the plan was made with 1"):
        site_planning.check_plan_fits(plan, ground(""), "plan.json")
    with pytest.raises(PlanFileError, match=r"the site has changed: .* area 'shed'"):
        site_planning.check_plan_fits(plan, ground(SHED), "plan.json")


def test_an_export_leads_around_as_well(place: Place) -> None:
    plan = place.planned(extra=area(name="yard", polygon=box(25, -14, 50, 14), margin_m=2))
    content = read_plan(plan)
    assert content.inspection is not None
    setup = setup_of_plan(content, content.inspection)
    assert [one.area.name for one in setup.kept_out] == ["yard"]
    assert setup.areas == content.areas
    place.run("export", plan, "-o", place.path("around"))
    plain = place.planned(extra="")
    place.run("export", plain, "-o", place.path("straight"))

    def items(folder: str) -> int:
        files = sorted((place.folder / folder).glob("*.plan"))
        return sum(len(json.loads(file.read_text())["mission"]["items"]) for file in files)

    assert items("around") > items("straight")


def test_a_run_directory_holds_the_files_of_areas(place: Place) -> None:
    ring = json.loads(box(70, 30, 290, 60))
    polygon = {"type": "Polygon", "coordinates": [[[lon, lat] for lat, lon in [*ring, ring[0]]]]}
    feature = {"type": "Feature", "properties": {"name": "pond"}, "geometry": polygon}
    for name in ("one", "two"):
        content = json.dumps({"type": "FeatureCollection", "features": [feature]})
        (place.folder / f"{name}.geojson").write_text(content)
    place.site(
        extra=area(file="one.geojson") + area(name="x", polygon=box(70, -70, 80, -50)) + area(file="two.geojson")
    )
    site = read_site(place.folder / "site.toml")
    ground = site_model.load_site_model(site, place.folder)
    plan = site_planning.plan_site(ground, site_planning.PlanRequest(None, 0.2, 1, usual=True))
    run = place.folder / "run"
    run.mkdir()
    write_run_start(FlightRequest(site, place.folder, ground, plan, run, lambda _: ()))
    for name in ("one.geojson", "two.geojson", "line.geojson"):
        (place.folder / name).unlink()
    again = site_model.load_site_model(read_site(RunDirectory(run).site), run)
    assert again.setup.areas == ground.setup.areas
    assert [one.name for one in again.setup.areas] == ["pond", "x", "pond"]
    site_planning.check_plan_fits(read_plan(RunDirectory(run).plan_path(0)), again, "plan-000.json")


def test_the_next_sortie_is_not_about_what_cannot_be_reached(place: Place) -> None:
    place.site(extra=SHED)
    ground = site_model.load_site_model(read_site(place.folder / "site.toml"), place.folder)
    never = tuple(one.segment for one in ground.setup.unreachable)
    assert never
    report = short_report([]).model_copy(update={"segments_uncovered": never, "faults": ()})
    assert plan_next_flight(ground, report, 1) is None
    more = report.model_copy(update={"segments_uncovered": (0, *never)})
    found = plan_next_flight(ground, more, 1)
    assert found is not None
    assert [segment.id for segment in found.segments] == [0]
    assert tuple(one.segment for one in found.unreachable) == never
    write_plan(place.folder / "next.json", found)
    assert read_plan(place.folder / "next.json").unreachable == found.unreachable


REFUSED: dict[str, tuple[str, str]] = {
    "the depot in it": (
        area(name="x", polygon=box(-50, -50, 50, 50)),
        "depot: expected 10 m or more outside of area 'x'",
    ),
    "nothing left": (
        area(name="x", polygon=box(30, -50, 400, 50)),
        "area: expected a segment that can be reached, found n",
    ),
    "no source": (area(name="x"), "area[0].file: expected one of file, polygon and line, got none"),
    "two sources": (
        area(file="a", polygon=box(1, 1, 2, 2)),
        "file: expected one of file, polygon and line, got file and",
    ),
    "no name": (area(polygon=box(1, 1, 2, 2)), "name: expected one with polygon"),
    "no width": (
        area(name="x", line=corners((1, 1), (2, 2))),
        "width_m: expected a width and no height limit with line",
    ),
    "a width": (area(name="x", polygon=box(1, 1, 2, 2), width_m=3), "width_m: expected none with polygon, got one"),
    "where beside a polygon": (
        area(name="x", polygon=box(1, 1, 2, 2), where="a = 1"),
        "where: expected none with polygon",
    ),
    "two corners": (area(name="x", polygon=corners((1, 1), (2, 2))), "area[0].polygon: "),
    "a small margin": (area(name="x", polygon=box(1, 1, 2, 2), margin_m=1), "area[0].margin_m: "),
    "a latitude": (area(name="x", polygon="[[95.0, 1.0], [1.0, 1.0], [1.0, 2.0]]"), "area[0].polygon[0][0]: "),
    "an unknown key": (area(name="x", polygon=box(1, 1, 2, 2), kind="park"), "area[0].kind: unknown key"),
    "a bow tie": (
        area(name="x", polygon=corners((100, 50), (200, 150), (200, 50), (100, 160))),
        "area[0] 'x': expected an outline that does not cross itself",
    ),
    "a line as a polygon": (
        area(name="x", polygon=corners((1, 1), (2, 2), (3, 3))),
        "expected an outline that encloses",
    ),
    "no file": (area(file="nowhere.geojson"), "nowhere.geojson: file: expected a readable"),
    "a place twice": (
        2 * '[[place]]\nname = "a"\nlat_deg = 1\nlon_deg = 1\nkind = "pad"\n',
        "place[1].name: expected a na",
    ),
    "a kind of place": ('[[place]]\nname = "a"\nlat_deg = 1\nlon_deg = 1\nkind = "hut"\n', "place[0].kind: "),
}


@pytest.mark.parametrize(("extra", "expected"), REFUSED.values(), ids=REFUSED)
def test_a_table_that_cannot_be_flown_by_is_refused(place: Place, extra: str, expected: str) -> None:
    place.site(extra=extra)
    assert expected in place.refused("plan", place.path("site.toml"))


LIMITS: dict[str, tuple[dict[str, Any], str | None]] = {
    "high enough": ({"max_agl_m": 40}, None),
    "too low for the higher one": ({"max_agl_m": 18}, "uav2 would be 22 m over the ground, 18 m allowed"),
    "too low for both": ({"max_agl_m": 10}, "uav2 would be 22 m over the ground, 10 m allowed"),
    "above the sea": ({"max_amsl_m": 15}, "uav2 would be 22 m above sea level, 15 m allowed"),
}


@pytest.mark.parametrize(("limit", "why"), LIMITS.values(), ids=LIMITS)
def test_a_height_limit_bars_what_some_vehicle_would_fly_above_it(
    place: Place, limit: dict[str, Any], why: str | None
) -> None:
    place.site(extra=area(name="glide path", polygon=box(190, -40, 400, 40), **limit))
    setup = site_model.load_site_model(read_site(place.folder / "site.toml"), place.folder).setup
    found = {one.segment: one.why for one in setup.unreachable}
    if why is None:
        assert (found, setup.kept_out) == ({}, ())
    else:
        assert set(found) == {2, 3}
        assert found[3] == f"lies in area 'glide path': {why}"


def test_a_vehicle_stands_on_the_pad_that_the_site_names_and_alternates_are_known(place: Place) -> None:
    lat_deg, lon_deg = FRAME.to_wgs84_deg(-40.0, 25.0)
    places = "".join(
        f'[[place]]\nname = "{name}"\nlat_deg = {lat_deg}\nlon_deg = {lon_deg}\nkind = "{kind}"\n'
        for name, kind in (("north field", "pad"), ("meadow", "alternate"))
    )
    place.site(extra=places)
    file = place.folder / "site.toml"
    file.write_text(file.read_text().replace("sysid = 2\n", 'sysid = 2\npad = "north field"\n'))
    setup = site_model.load_site_model(read_site(file), place.folder).setup
    pad = setup.pad_of("uav2")
    assert (pad.east_m, pad.north_m) == pytest.approx((-40.0, 25.0), abs=0.01)
    assert setup.alternates == ("meadow",)
    file.write_text(file.read_text().replace('pad = "north field"', 'pad = "meadow"'))
    assert (
        "vehicle[1].pad: expected the name of a [[place]] of kind 'pad', 'north field', got 'meadow'"
        in place.refused("plan", str(file))
    )


def test_many_corners_are_simplified_and_more_is_kept_from_them(place: Place) -> None:

    ring = [
        (2000 + 1500 * math.cos(2 * math.pi * n / 2000), 1500 * math.sin(2 * math.pi * n / 2000)) for n in range(2000)
    ]
    place.site(extra=area(name="town", polygon=corners(*ring)))
    ground = site_model.load_site_model(read_site(place.folder / "site.toml"), place.folder)
    [town] = ground.setup.areas
    assert len(town.rings_m[0]) <= 400
    assert (town.eased_m, town.keep_m) == (0.5, 10.5)
    assert any("2000 corners are simplified to" in line for line in ground.worth_a_look)


def test_areas_far_away_are_left_out_and_that_is_reported(place: Place) -> None:
    place.site(extra=area(name="far", polygon=box(90_000, 0, 91_000, 1000)))
    ground = site_model.load_site_model(read_site(place.folder / "site.toml"), place.folder)
    assert ground.setup.areas == ()
    assert ground.worth_a_look == (
        "areas: none of area[0] 'far' is within 20 km of the lines; are latitude and longitude swapped?",
    )
    assert len(read_network(place.folder / "line.geojson", depot=(*DEPOT, 0.0)).segments) == 4


def test_a_picture_of_the_plan_shows_areas_and_the_ways_around_them(place: Place) -> None:
    plan = read_plan(place.planned(extra=area(name="yard", polygon=box(25, -14, 50, 14), margin_m=2)))
    turns = [turn for route in build_launch_revision(plan).routes for leg in route.legs_m for turn in leg[1:-1]]
    assert turns
    figure = draw_plan_figure(plan)
    [axes] = figure.axes
    assert "yard" in [text.get_text() for text in axes.texts]
    [key] = figure.legends
    assert "areas that flights keep out of" in [text.get_text() for text in key.get_texts()]
    drawn = np.concatenate([np.asarray(line.get_xydata()) for line in axes.lines])
    assert all(np.nanmin(np.hypot(*(drawn - np.array(turn)).T)) < 0.01 for turn in turns)
