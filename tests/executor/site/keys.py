"""A value for every key of the site file that makes a difference, and what each way into a flight makes of a site."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from copy import deepcopy
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property, lru_cache
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import certifi
import numpy as np
import pytest

from executor.adapters.run_directory import RunDirectory
from executor.analysis.documents import AskedVehicles
from executor.cli import exports
from executor.cli.options import FormatName
from executor.core.context import Context
from executor.errors import ExecutorError
from executor.flight.run_start import (
    FlightRequest,
    build_context_and_boards,
    read_mqtt_settings,
    read_run_start,
    write_run_start,
)
from executor.site import day_plans, site_model, site_planning
from executor.site.day_plans import build_day_problem, list_spares, solve_day
from executor.site.flight_keys import DayTable
from executor.site.ground_view import read_ground_files, view_for
from executor.site.site_file import Site, check_site, read_signing_key
from executor.site.site_model import SiteModel
from executor.site.site_planning import DEFAULT
from missions import (
    DayPlanFile,
    LocalFrame,
    MissionsError,
    PlanFile,
    build_plan_document,
    check_plan,
    read_any_plan,
    write_plan,
)
from planner import Cost, PlannerError
from tests.brokers import secured_in
from tests.missions.readers.pictures import write_tiff
from tests.mountains import LAT_DEG, LON_DEG, Mountain, write_raster

REFUSALS = (ExecutorError, MissionsError, PlannerError)
Tables = dict[str, Any]
Changes = tuple[tuple[str, object], ...]
REQUEST = replace(DEFAULT, cost=Cost.MINMAX, usual=False, seconds=60.0, iterations=30, starts=1)
ENVIRONMENT = {"CREW": "crew", "WORD": "kites-at-noon", "TOKEN": "a-long-enough-token", "KEY": "a passphrase"}
WAYS = ("flight", "day", "re-plan", "resume", "check", "export")
HILLS = Mountain(seed=3, base_m=900.0, relief_m=15.0, gorge_m=0.0, step_m=0.0)


def as_text(value: object) -> object:
    """Return a value as plain lists and texts, so that two of them are equal exactly if they say the same."""
    if is_dataclass(value) and not isinstance(value, type):
        return {one.name: as_text(getattr(value, one.name)) for one in fields(value) if not one.name.startswith("_")}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return sorted(((repr(key), as_text(held)) for key, held in value.items()), key=lambda one: str(one[0]))
    if isinstance(value, frozenset | set):
        return sorted(map(repr, value))
    if isinstance(value, tuple | list):
        return [as_text(one) for one in value]
    return repr(value)


@dataclass(frozen=True)
class Loaded:
    """A site as a command has it."""

    site: Site
    folder: Path
    ground: SiteModel

    @property
    def beside(self) -> object:
        """What a supervised flight takes from the site's tables and not from its plan."""
        site, flight = self.site, self.site.flight
        mqtt = read_mqtt_settings(site.mqtt, self.folder, "site.toml", ENVIRONMENT)
        if mqtt is not None:
            broker = replace(mqtt.broker, identifier="", tls=None)
            mqtt = replace(mqtt, broker=broker)
        links = [(one.link, one.sysid, one.backend) for one in site.vehicle]
        waits = (flight.connect_timeout_s, flight.ready_timeout_s, flight.speedup, flight.solve_s)
        certificates = None if site.mqtt is None else (
            site.mqtt.ca_file, site.mqtt.key_password_env,
            *(one and (self.folder / one).read_bytes() for one in (site.mqtt.cert_file, site.mqtt.key_file)),
        )  # fmt: skip
        return as_text((
            mqtt, certificates, links, waits, read_signing_key(site, self.folder), site.link.senders, site.link.station,
            site.forward, site.web,
        ))  # fmt: skip

    @property
    def below(self) -> object:
        """What its maps show below the line."""
        view = view_for(self.ground, self.folder)
        return view.attribution, view.background is None, None if view.relief is None else as_text(view.relief)

    @property
    def sets_day(self) -> bool:
        """Whether the site says anything of days."""
        return self.site.day != DayTable() or bool(self.site.base)

    @cached_property
    def plan(self) -> PlanFile:
        """The plan of one flight."""
        found = site_planning.plan_site(self.ground, REQUEST)
        assert check_plan(found, search_window=False) == []
        return replace(found, seconds=0.0)

    @cached_property
    def day(self) -> DayPlanFile:
        """The plan of a day."""
        found = solve_day(build_day_problem(self.ground), REQUEST, list_spares(self.ground))
        assert check_plan(found) == []
        return replace(found, seconds=0.0)

    @cached_property
    def first(self) -> PlanFile:
        """What is flown first of the day."""
        return day_plans.build_first_sorties_plan(self.day, self.ground)


def load(tables: Tables, folder: Path) -> Loaded:
    site = check_site(deepcopy(tables), "site.toml")
    return Loaded(site, folder, site_model.load_site_model(site, folder))


def document(content: PlanFile | DayPlanFile) -> object:
    return as_text(build_plan_document(content))


def begin(loaded: Loaded, content: PlanFile, day: DayPlanFile | None = None) -> tuple[Context, object]:
    context, boards = build_context_and_boards(loaded.ground, loaded.ground.setup, content, day, {}, {})
    return context, as_text((context, boards))


def fly(loaded: Loaded) -> object:
    content = loaded.plan
    return document(content), begin(loaded, content)[1], loaded.beside, loaded.below


def fly_day(loaded: Loaded) -> object:
    day = loaded.day
    ahead = day_plans.sorties_ahead_of(day)
    return document(day), begin(loaded, loaded.first, day)[1], as_text(ahead), loaded.beside, loaded.below


def decide(context: Context) -> object:
    """Return what a flight answers a loss with."""
    return as_text((
        context.setup, context.pricing, context.vehicles, context.horizon_s, context.fly_again, context.fencing,
        context.drone, context.limits, context.pilot_returns, context.pilot_grace_s, context.corridor_m,
        context.offer_s, context.infers, context.camera_home, context.inspection_speed_m_s, context.wind_m_s,
        context.day,
    ))  # fmt: skip


def replan(loaded: Loaded) -> object:
    """Return the answer to a loss, by the command and by what a flight, or a day, decides it with."""
    content = loaded.plan
    at_s = 0.3 * max(content.durations_s)
    lost = content.vehicles[0].name
    found, _ = site_planning.preview_loss(content, lost, at_s, cost=Cost.MINMAX, seconds=60.0, seed=1)
    answer = document(replace(found, seconds=0.0))
    later = None
    if loaded.sets_day:
        later = decide(begin(loaded, loaded.first, loaded.day)[0])
    return answer, decide(begin(loaded, content)[0]), later


def resume(loaded: Loaded) -> object:
    """Return what a run directory gives back of a flight, and of a day, after the site's own folder is gone."""
    flights: list[tuple[PlanFile, DayPlanFile | None]] = [(loaded.plan, None)]
    if loaded.sets_day:
        flights.append((loaded.first, loaded.day))
    return [_resume(loaded, content, day) for content, day in flights]


def _resume(loaded: Loaded, content: PlanFile, day: DayPlanFile | None) -> object:
    run = loaded.folder / "run"
    shutil.rmtree(run, ignore_errors=True)
    run.mkdir()
    write_run_start(FlightRequest(loaded.site, loaded.folder, loaded.ground, content, run, lambda _: (), day=day))
    AskedVehicles(format="faultline-vehicles/1", vehicles=(), counts_packs=True).write(RunDirectory(run).vehicles)
    found = read_run_start(run)
    again, below = Loaded(found.ground.site, run, found.ground), read_ground_files(run)
    flown = document(replace(found.plan, seconds=content.seconds))
    return flown, as_text((found.context, found.state)), again.beside, below


def check(loaded: Loaded) -> object:
    """Return what `check` recomputes of the file of a flight, and of a day."""
    said, path = [], loaded.folder / "plan.json"
    for content in (loaded.plan, loaded.day):
        write_plan(path, content)
        read = read_any_plan(path)
        assert check_plan(read, search_window=False) == []
        said.append(document(read))
    return said


def export(loaded: Loaded) -> object:
    path, out = loaded.folder / "plan.json", loaded.folder / "exported"
    site = loaded.folder / "site.json"
    shutil.rmtree(out, ignore_errors=True)
    write_plan(path, loaded.plan)
    with pytest.MonkeyPatch.context() as patch:
        # A plan over a raster is exported beside its site: this one is in memory.
        patch.setattr(exports, "read_site", lambda _: loaded.site)
        for to in (FormatName.QGC, FormatName.KML):
            exports.export(path, out, to, None, site)
    return {one.name: one.read_text(encoding="utf-8") for one in sorted(out.iterdir())}


MAKE: Mapping[str, Callable[[Loaded], object]] = dict(
    zip(WAYS, (fly, fly_day, replan, resume, check, export), strict=True)
)


def outcomes(tables: Tables, folder: Path) -> dict[str, object]:
    """Return what each way makes of a site; in words where it refuses it."""
    try:
        loaded = load(tables, folder)
    except REFUSALS as error:
        return dict.fromkeys(WAYS, f"refused: {error}")
    return {way: _outcome(way, loaded) for way in WAYS}


@lru_cache(maxsize=4)
def outcomes_of(tables: str, folder: Path) -> dict[str, object]:
    """Return the same of a site as JSON, kept for the next keys: many are changed in the same site."""
    return outcomes(json.loads(tables), folder)


def _outcome(way: str, loaded: Loaded) -> object:
    try:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            return MAKE[way](loaded)
    except REFUSALS as error:
        return f"refused: {error}"


def compare(key: str, folder: Path) -> dict[str, str]:
    """Return for each way whether a key holds, is refused, or plays no part."""
    site, changed_site = sites_of(key)
    before, after = outcomes_of(json.dumps(site), folder), outcomes(changed_site, folder)
    return {
        way: "refused" if isinstance(after[way], str) else "holds" if after[way] != before[way] else "-" for way in WAYS
    }


def at(east_m: float, north_m: float) -> tuple[float, float]:
    """Return longitude and latitude of a place beside the depot, well enough for a line of a few hundred metres."""
    return LON_DEG + east_m / (111_320 * math.cos(math.radians(LAT_DEG))), LAT_DEG + north_m / 111_190


ROW_A, ROW_B = ((60, 60), (60, 180), (90, 300)), ((-80, 60), (-80, 190), (-40, 300))
SCHOOL, QUARRY = ((40, 130), (90, 130), (90, 150), (40, 130)), ((-100, 120), (-60, 120), (-60, 150), (-100, 120))
GAP = ((60, 60), (60, 180), (60, 180.9), (60, 300))


def feature(shape: str, coordinates: object, **properties: object) -> Tables:
    return {"type": "Feature", "geometry": {"type": shape, "coordinates": coordinates}, "properties": properties}


def collection(*features: Tables) -> str:
    return json.dumps({"type": "FeatureCollection", "features": features})


def pole(place: tuple[float, float], name: str, **more: object) -> Tables:
    return feature("Point", at(*place), id=name, elevation_m=900.0, **more)


def line(name: str, places: Sequence[tuple[float, float]], **more: object) -> Tables:
    return feature("LineString", [at(*place) for place in places], name=name, **more)


def write_files(folder: Path) -> None:
    """Write what the sites below name: lines in several formats, a raster, areas, pictures, secrets."""
    poles = [pole(place, f"{row}{number}", height_m=25.0 + number)
             for row, places in (("A", ROW_A), ("B", ROW_B)) for number, place in enumerate(places, 1)]  # fmt: skip
    lines = [line("A", ROW_A, voltage=110_000), line("B", ROW_B, voltage=22_000)]
    texts = {
        "line.geojson": collection(*poles, *lines),
        "other.geojson": collection(*poles[:3], lines[0]),
        "no-heights.geojson": collection(*(pole(place, f"A{place[1]}") for place in ROW_A), lines[0]),
        "tall.geojson": collection(*(pole(place, f"A{place[1]}", height_m=180.0) for place in ROW_A), lines[0]),
        "gap.geojson": collection(line("A", GAP[:2]), line("A2", GAP[2:])),
        "bare.geojson": collection(line("A", ROW_A)),
        "folders.kml": _folders_kml((ROW_A, ROW_B), "LineString"),
        "grid.csv": "line,order,easting,northing\nA,1,607300,5161900\nA,2,607300,5162020\nA,3,607320,5162140\n",
        "areas.geojson": collection(
            *(
                feature("Polygon", [[at(*one) for one in ring]], kind=kind)
                for ring, kind in ((SCHOOL, "school"), (QUARRY, "quarry"))
            )
        ),
        "areas.kml": _folders_kml((SCHOOL, QUARRY), "Polygon"),
        "key.txt": "the passphrase of a file",
        "school.geojson": collection(feature("Polygon", [[at(*one) for one in SCHOOL]])),
        "packs.json": json.dumps({"format": "faultline-packs/1", "flights": [PACK]}),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    named = "line,order,lat,lon\n" + "".join(
        f"Žďár,{number},{at(*place)[1]},{at(*place)[0]}\n" for number, place in enumerate(ROW_A, 1)
    )
    (folder / "named.csv").write_bytes(named.encode("cp1250"))
    write_raster(folder / "hills.tif", HILLS)
    write_raster(folder / "hills2.tif", HILLS, shift_m=2.0)
    write_tiff(folder / "ground.tif", LocalFrame(LAT_DEG, LON_DEG, 900.0), tags={"TIFFTAG_COPYRIGHT": "Land survey"})
    shutil.copy(certifi.where(), folder / "ca.pem")
    secured_in(folder)


PACK: Tables = {
    "log": "a.tlog", "vehicle": "uav1", "pack": 1, "label": "A7", "began_usec": 1_800_000_000_000_000, "minutes": 12.0,
    "cells": 4, "rest_cell_v": 4.18, "end_cell_v": 3.7, "began_pct": 100.0, "ended_pct": 50.0, "sag_cell_v": 0.12,
    "ohm": 0.024, "ohm_sd": 0.001, "counted_ah": 2.5, "set_ah": 5.0, "least_ah": 3.2, "most_ah": 3.5,
}  # fmt: skip


def _folders_kml(rows: Sequence[Sequence[tuple[float, float]]], shape: str) -> str:
    ring = ("<outerBoundaryIs><LinearRing>", "</LinearRing></outerBoundaryIs>") if shape == "Polygon" else ("", "")
    folders = "".join(
        f"<Folder><name>{name}</name><Placemark><name>{name}</name><{shape}>{ring[0]}<coordinates>"
        + " ".join(f"{lon},{lat},0" for lon, lat in (at(*place) for place in places))
        + f"</coordinates>{ring[1]}</{shape}></Placemark></Folder>"
        for name, places in zip(("North", "South"), rows, strict=True)
    )
    return f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{folders}</Document></kml>'


def changed(tables: Tables, *changes: tuple[str, object]) -> Tables:
    """Return tables in which some keys, such as `vehicle[0].pad`, have another value; None takes one away."""
    found = deepcopy(tables)
    for key, given in changes:
        value = deepcopy(given)  # later changes may be within it
        *path, last = [int(one) if one.isdigit() else one for one in key.replace("[", ".").replace("]", "").split(".")]
        table: Any = found
        for one in path:
            table = table[one] if isinstance(one, int) else table.setdefault(one, {})
        if value is None:
            table.pop(last)
        elif isinstance(last, int) and last == len(table):
            table.append(value)
        else:
            table[last] = value
    return found


BASE: Tables = {
    "depot": {"lat_deg": LAT_DEG, "lon_deg": LON_DEG, "alt_m": 900.0},
    "network": {"file": "line.geojson"},
    "vehicle": [
        {"name": f"uav{number}", "connection": f"udpin://127.0.0.1:{14550 + number}", "sysid": number,
         "autopilot": "ardupilot"}
        for number in (1, 2)
    ],
    "day": {},
}  # fmt: skip
FLAT = (("inspection.heights", "flat"),)
TERRAIN = (("terrain", {"files": "hills.tif", "vertical": "egm2008", "uncertainty_m": 1.0}),
           ("inspection.ceiling_m", 300.0), ("inspection.return_ceiling_m", 400.0))  # fmt: skip
SQUARE = [[at(x, y)[1], at(x, y)[0]] for x, y in ((20, 400), (60, 400), (60, 440), (20, 440))]
LATER = [[at(x, y)[1], at(x, y)[0]] for x, y in ((40, 130), (80, 130), (80, 160), (40, 160))]
AREA = (("area", [{"name": "yard", "polygon": SQUARE}]),)
AREAS = (("area", [{"name": "yard", "file": "areas.geojson"}]),)
ROAD_AREA = (("area", [{"name": "road", "line": SQUARE[:2], "width_m": 30.0}]),)
PLACE = (("place", [{"name": "hill", "kind": "pad", "lat_deg": at(40, -20)[1], "lon_deg": at(40, -20)[0]}]),
         ("vehicle[0].pad", "hill"))  # fmt: skip
CAMERA = (("camera", [{"name": "zoom", "focal_mm": 20.0, "sensor_mm": [20.0, 15.0], "image_px": [4000, 3000]}]),)
LOOK = (*CAMERA, ("look", [{"camera": "zoom", "every_m": 20.0}]))
PYLONS = (
    *CAMERA,
    ("look", [{"camera": "zoom", "of": "pylons", "bearings_deg": [60, 120]}]),
    ("camera[0].gimbal", True),
)
LOCK = (("lock", [{"segments": ["A.1"], "vehicle": "uav1"}]),)
DAY = (("vehicle[0].budget_pct", 7.0), ("vehicle[1].budget_pct", 7.0))
"""With so little each vehicle needs two sorties."""
BESIDE = at(150, 150)
BASES = (("base", [{"name": "a", "lat_deg": at(0, 0)[1], "lon_deg": at(0, 0)[0], "vehicles": ["uav1"]},
                   {"name": "b", "lat_deg": BESIDE[1], "lon_deg": BESIDE[0], "vehicles": ["uav2"]}]),)  # fmt: skip
MQTT = (("mqtt", {"host": "127.0.0.1"}),)
FENCE = (("fence", {"enabled": True}),)
LEARNED = (("learned", {"logs": 1, "minutes": 10.0}),)
FIGURE = {"mean": 9.0, "sd": 1.0, "samples": 4}
LEVEL = {"speed_m_s": 5.0, "current_a": FIGURE}
STATION = "udpout://127.0.0.1:14590"
RADIO = {"system": 51, "component": 68}
QUIET = (("day.quiet", [{"begin": "08:00", "end": "08:30"}]),)
ROAD = (
    *BASES,
    ("fence", {"enabled": True}),
    ("day.lands", "any"),
    ("day.road", [{"between": ["a", "b"], "minutes": 5}]),
)
ELSEWHERE = at(60, -30)
FAR = at(-90, -20)


def _of_table(table: str, needs: Changes, **values: object) -> dict[str, tuple[Changes, object]]:
    return {f"{table}.{key}": (needs, value) for key, value in values.items()}


KEYS: dict[str, tuple[Changes, object]] = {
    **_of_table("depot", (), lat_deg=LAT_DEG + 2e-4, lon_deg=LON_DEG + 2e-4, alt_m=905.0),
    **_of_table("network", (), file="other.geojson", where="voltage >= 100000", radius_m=250.0,
                only=["B"], leave_out=["A.1"]),
    **_of_table("lock[0]", LOCK, segments=["B.1..B.2"], vehicle="uav2"),
    "lock[0].from": (LOCK, "A1"),
    "network.layer": ((("network.file", "folders.kml"), ("network.layer", ["North", "South"]), *FLAT), "North"),
    "network.snap_m": ((("network.file", "gap.geojson"), *FLAT), 5.0),
    "network.max_span_m": ((("network.file", "bare.geojson"), *FLAT), 50.0),
    "network.crs": ((("network.file", "grid.csv"), ("network.crs", "EPSG:32632"), *FLAT), "EPSG:23032"),
    "network.encoding": ((("network.file", "named.csv"), ("network.encoding", "cp1250"), *FLAT), "cp1252"),
    "network.tallest_m": ((("network.file", "tall.geojson"), ("inspection.ceiling_m", 900.0)), 180.0),
    "network.pylon_height_m": ((("network.file", "no-heights.geojson"), *FLAT), 30.0),
    **_of_table("terrain", TERRAIN, files="hills2.tif", vertical="egm96", margin_m=60.0, uncertainty_m=9.0,
                line_margin_m=14.0),
    **_of_table("inspection", (), height_m=18.0, ceiling_m=30.0, standoff_m=9.0, speed_m_s=4.0, transit_speed_m_s=9.0,
                wind_m_s=[3.0, 1.0], layer_m=6.0, same_distance=True, corridor_m=12.0),
    "inspection.heights": ((("network.file", "bare.geojson"),), "flat"),
    "inspection.return_ceiling_m": (TERRAIN, 30.0),
    **_of_table("energy", (), drone="mavic2", mass_kg=1.2, rotors=6, propeller_radius_m=0.2, cells=6, capacity_ah=9.0,
                chemistry="li-ion", area_m2=0.09, efficiency=0.6),
    "energy.packs": ((("vehicle[0].pack", "A7"),), "packs.json"),
    **_of_table("area[0]", AREA, name="court", polygon=LATER),
    **_of_table("area[0]", (("area", [{"name": "yard", "polygon": LATER}]),), max_agl_m=100.0, max_amsl_m=1000.0),
    "area[0].margin_m": ((("area", [{"name": "yard", "polygon": LATER, "margin_m": 2.0}]),), 30.0),
    "area[0].file": (AREAS, "school.geojson"),
    "area[0].layer": ((("area", [{"name": "yard", "file": "areas.kml", "layer": ["North", "South"]}]),), "South"),
    "area[0].where": (AREAS, "kind = 'school'"),
    **_of_table("area[0]", ROAD_AREA, line=LATER[:2], width_m=300.0),
    **_of_table("place[0]", PLACE, lat_deg=ELSEWHERE[1], lon_deg=ELSEWHERE[0], alt_m=903.0),
    "place[0].name": (PLACE[:1], "mound"),
    "place[0].kind": (PLACE[:1], "alternate"),
    **_of_table("vehicle[0]", (), name="bee", connection="udpin://127.0.0.1:14600", sysid=7, autopilot="px4",
                backend="mavsdk", budget_pct=4.5, reserve_pct=20.0),
    "vehicle[0].pack": ((("energy.packs", "packs.json"),), "A7"),
    "vehicle[0].pad": (PLACE[:1], "hill"),
    **_of_table("flight", (), speedup=5.0, solve_s=2.0, connect_timeout_s=20.0, ready_timeout_s=60.0, fly_again="never",
                offer_s=100.0, pilot_grace_s=10.0, pilot_return="auto", inferred="fly"),
    **_of_table("faults", (), link_timeout_s=30.0, link_stale_s=2.0, battery_step_pct=5.0, battery_excess_pct=3.0,
                battery_window_s=60.0, camera="on"),
    **_of_table("fence", FENCE, enabled=False, margin_m=40.0, height_margin_m=20.0, action="return", rally="keep"),
    "signing.key_file": ((("signing", {"key_env": "KEY"}),), "key.txt"),
    "signing.key_env": ((("signing", {"key_file": "key.txt"}),), "KEY"),
    **_of_table("link", (), station_sysid=254, bytes_s=900.0, one_radio=True),
    "link.radios": ((), [RADIO]),
    **_of_table("link.radios[0]", (("link", {"radios": [RADIO]}),), system=52, component=69),
    **_of_table("forward", (("forward", {"to": [STATION]}),), to=["tcpin://127.0.0.1:5761"], allow_orders=True),
    "forward.bytes_s": ((("forward", {"to": [STATION], "allow_orders": True}),), 100.0),
    **_of_table("mqtt", MQTT, host="localhost", port=1884, prefix="line", telemetry_rate_hz=2.0, tls=True,
                protocol="5", websocket_path="/mqtt", clear_retained=True,
                username_env="CREW", token_env="TOKEN", intent_max_age_s=5.0),  # noqa: S106 - a variable's name
    "mqtt.ca_file": ((("mqtt", {"tls": True}),), "ca.pem"),
    "mqtt.cert_file": ((("mqtt", {"tls": True}),), "client.pem"),
    "mqtt.key_file": ((("mqtt", {"tls": True, "cert_file": "client.pem"}),), "client.pem"),
    "mqtt.key_password_env": ((("mqtt", {"tls": True, "cert_file": "client.pem"}),), "WORD"),
    "mqtt.password_env": ((("mqtt", {"username_env": "CREW"}),), "WORD"),
    **_of_table("web", (), enabled=False, host="127.0.0.2", port=8123, token_env="TOKEN", names=["laptop"],  # noqa: S106
                address="http://127.0.0.1:8080/"),
    "map.background": ((), "ground.tif"),
    "map.attribution": ((("map", {"background": "ground.tif"}),), "the crew"),
    "map.contour_m": (TERRAIN, 5.0),
    **_of_table("learned", LEARNED, logs=2, minutes=11.0, hover_a=FIGURE, hover_w=FIGURE, level=[LEVEL],
                climb_share=FIGURE, capacity_ah=FIGURE, resistance_ohm=FIGURE, link_loss_pct=FIGURE,
                mode_switch={"channel": 5, "source": "seen"}),
    **_of_table("learned.hover_a", (*LEARNED, ("learned.hover_a", FIGURE)), mean=8.0, sd=2.0, samples=5),
    **_of_table("learned.level[0]", (*LEARNED, ("learned.level", [LEVEL])), speed_m_s=6.0,
                current_a={**FIGURE, "mean": 8.0}, pct_per_min=FIGURE),
    **_of_table("learned.mode_switch", (*LEARNED, ("learned.mode_switch", {"channel": 5, "source": "seen"})),
                channel=6, source="FLTMODE_CH", moved=1, changes=2),
    **_of_table("camera[0]", LOOK, id=100, vehicles=["uav1"], least_interval_s=0.5, gimbal=True),
    **_of_table("camera[0]", (*CAMERA, ("look", [{"camera": "zoom", "overlap_pct": 20.0, "sample_mm": 9.0}])),
                focal_mm=18.0, sensor_mm=[24.0, 15.0], image_px=[3900, 2900]),
    "look[0].sample_mm": ((*CAMERA, ("look", [{"camera": "zoom", "overlap_pct": 20.0, "sample_mm": 4.0}])), 9.0),
    "camera[0].name": (CAMERA, "wide"),
    **_of_table("look[0]", (*LOOK, ("camera[0].gimbal", True)), segments=["A*"], trigger="interval", every_m=30.0,
                pitch_deg=-60.0, aim_deg=30.0),
    "look[0].camera": ((*LOOK, ("camera[1]", {"name": "wide", "vehicles": ["uav2"]})), "wide"),
    "look[0].of": ((*LOOK, ("look[0].bearings_deg", [60, 120])), "pylons"),
    "look[0].take": (LOOK, "video"),
    "look[0].overlap_pct": ((*CAMERA, ("look", [{"camera": "zoom", "overlap_pct": 20.0}])), 30.0),
    **_of_table("look[0]", PYLONS, pylons=["A1"], bearings_deg=[30, 150], both_sides=True, distance_m=16.0,
                target_m=-3.0, roi=True, hover_s=4.0),
    "look[0].heights_m": ((*PYLONS, ("inspection.same_distance", True)), [4.0]),
    **_of_table("day", DAY, begin="09:00", end="08:03", days=2, stagger_s=300.0),
    "day.lands": (BASES, "any"),
    "day.road_m_s": ((*ROAD[:-1], *DAY), 3.0),
    "day.road": ((*ROAD[:-1], *DAY), ROAD[-1][1]),
    "day.quiet": ((), QUIET[0][1]),
    "day.vehicle": (DAY, [{"name": "uav2", "spare": True}]),
    **_of_table("day.road[0]", (*ROAD, *DAY), minutes=50),
    "day.road[0].between": ((*ROAD, ("base[2]", {"name": "c", "lat_deg": FAR[1], "lon_deg": FAR[0]})), ["b", "c"]),
    **_of_table("day.quiet[0]", QUIET, begin="08:20", end="08:40", vehicles=["uav1"]),
    **_of_table("day.vehicle[0]", (*DAY, ("day.vehicle", [{"name": "uav2"}])), speed_m_s=2.0, transit_speed_m_s=4.0,
                segments=["A.1"], spare=True),
    "day.vehicle[0].name": ((("day.vehicle", [{"name": "uav2", "segments": ["A.1"]}]),), "uav1"),
    **_of_table("base[0]", (*BASES, *DAY), name="camp", lat_deg=FAR[1], lon_deg=FAR[0], packs=1, turnaround_s=400.0),
    "base[0].alt_m": ((*BASES, ("base[0].lon_deg", FAR[0])), 903.0),
    "base[0].vehicles": (BASES, ["uav2"]),
    "base[0].recharge_s": ((*BASES, *DAY, ("base[0].packs", 1)), 900.0),
}  # fmt: skip
"""Of each key what a site needs beside it, and a value that is another than it has then."""


INSTEAD: dict[str, Changes] = {
    "signing.key_file": (("signing.key_env", None),),
    "signing.key_env": (("signing.key_file", None),),
    "look[0].take": (("look[0].every_m", None),),
    "base[0].vehicles": (("base[1].vehicles", ["uav1"]),),
}
"""What has to change with a key."""


def sites_of(key: str) -> tuple[Tables, Tables]:
    """Return two sites that differ in one key."""
    needs, value = KEYS[key]
    before = changed(BASE, *needs)
    return before, changed(before, *INSTEAD.get(key, ()), (key, value))


def rows(folder: Path) -> Iterator[str]:
    """Yield the rows of the page, as they are now."""
    for key in KEYS:
        found = compare(key, folder)
        yield f"| `{key.replace('[0]', '')}` | {' | '.join(found[way] for way in WAYS)} |"


if __name__ == "__main__":
    with TemporaryDirectory() as made, pytest.MonkeyPatch.context() as patched:
        for name, value in ENVIRONMENT.items():
            patched.setenv(name, value)
        write_files(Path(made))
        print("\n".join(rows(Path(made))))
