"""A server for the plan page that keeps its site in memory, over real plans of faultline's own network.

`python -m tests.fakes.plan_server PORT` serves it.
"""

from __future__ import annotations

import asyncio
import json
import sys
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import uvicorn
from pydantic import ValidationError
from pydantic._internal._docs_extraction import extract_docstrings_from_cls
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route

from executor.adapters.web.guard import HEADERS
from executor.adapters.web.server import STATIC, TYPES
from executor.site import flight_keys, mqtt_and_web_keys, site_keys, site_model, site_planning
from executor.site.site_file import Site
from executor.site.site_planning import DEFAULT
from missions import PlanFile
from planner import Cost

REQUEST = replace(DEFAULT, cost=Cost.MINMAX, usual=False, seconds=20.0, iterations=20, starts=1)
VALUES: dict[str, Any] = {
    "network": {"file": "default", "radius_m": 900.0},
    "inspection": {"height_m": 15.0},
    "vehicle": [
        {"name": f"uav{number}", "connection": f"udpin://0.0.0.0:{14539 + number}", "sysid": number, "autopilot": "ardupilot"}
        for number in (1, 2, 3)
    ],
}


@cache
def schema() -> dict[str, Any]:
    """Return the site file's schema with what keys mean."""
    found = Site.model_json_schema()
    for module in (site_keys, flight_keys, mqtt_and_web_keys):
        for name, table in vars(module).items():
            if name in found["$defs"]:
                for key, words in extract_docstrings_from_cls(table).items():
                    found["$defs"][name]["properties"].get(key, {})["description"] = words.replace("\n", " ")
    return found


@dataclass
class FakePlanServer:
    """One site and its plans."""

    values: dict[str, Any] | None = field(default_factory=lambda: deepcopy(VALUES))
    revision: int = 1
    undos: list[tuple[dict[str, Any], str]] = field(default_factory=list)
    redos: list[tuple[dict[str, Any], str]] = field(default_factory=list)
    plans: dict[str, PlanFile] = field(default_factory=dict)
    chosen: str | None = None
    job: dict[str, Any] | None = None
    problems: list[dict[str, Any]] = field(default_factory=list)
    news: asyncio.Condition | None = None

    def __post_init__(self) -> None:
        self.judge()

    def judge(self) -> None:
        """Look at the site."""
        self.problems, self.ground = [], None
        if self.values is None:
            return
        tables = {key: deepcopy(value) for key, value in self.values.items() if key != "lock"}
        for key in ("leave_out", "only"):
            tables.get("network", {}).pop(key, None)
        try:
            site = Site.model_validate(tables)
            self.ground = site_model.load_site_model(site, Path())
        except ValidationError as error:
            one = error.errors()[0]
            path = [part for part in one["loc"] if not isinstance(part, str) or not part.startswith("function")]
            self.problems = [{"path": path, "message": f"{one['msg']}"}]
        except Exception as error:  # noqa: BLE001
            self.problems = [{"path": ["network"], "message": str(error)}]

    def workspace(self) -> dict[str, Any]:
        segments = 0 if self.ground is None else len(self.ground.network.segments)
        return {
            "revision": self.revision, "values": self.values or {}, "problems": self.problems,
            "site": None if self.values is None else {"path": "/home/crew/line/site.toml", "name": "V101 spring", "text": ""},
            "undo": self.undos[-1][1] if self.undos else None, "redo": self.redos[-1][1] if self.redos else None,
            "network": None if self.ground is None else {"digest": f"{segments}", "segments": segments},
            "plans": [self.summary(one) for one in self.plans], "chosen": self.chosen, "job": self.job, "saved": True,
            "save_error": None, "tabs": 1,
        }  # fmt: skip

    def summary(self, name: str) -> dict[str, Any]:
        plan = self.plans[name]
        window = plan.window
        return {
            "id": name, "file": f"{name}.json", "longest_s": max(plan.durations_s),
            "energy_pct": dict(zip(plan.names, plan.energies_pct, strict=True)),
            "window_pct": None if window is None else window.window_pct,
            "window_from_s": None if window is None else window.earliest_s,
            "breaking": None if window is None or window.breaking is None else {
                "vehicle": window.breaking.vehicle, "from_s": window.breaking.from_s, "to_s": window.breaking.to_s},
            "uncovered": len(plan.uncovered), "cost": plan.cost.name, "stale": False,
        }  # fmt: skip

    def document(self, name: str) -> dict[str, Any]:
        plan = self.plans[name]
        return {"summary": self.summary(name), "vehicles": self.vehicles(plan),
                "uncovered": [{"segment": one, "why": "no battery left"} for one in plan.uncovered],
                "lines": ["heights: over the ground of the network file", "any two vehicles stay at least 5 m apart"]}  # fmt: skip

    def vehicles(self, plan: PlanFile) -> list[dict[str, Any]]:
        assert self.ground is not None
        routes = {route.vehicle: route for route in plan.routes}
        paths = site_model.build_paths(self.ground.setup, plan.network_routes)
        found = []
        for vehicle in plan.vehicles:
            own, route = [], routes.get(vehicle.name)
            profile: list[list[float | None]] = []
            if route is not None and route.visits and vehicle.name in paths:
                points = paths[vehicle.name].waypoints
                pad = plan.vehicles[plan.names.index(vehicle.name)]
                frame = self.ground.network.frame
                start = frame.to_wgs84_deg(*pad.start_m)
                corners = [(start[0], start[1], 0.0), *((one.lat_deg, one.lon_deg, one.alt_rel_m) for one in points)]
                east = 111_320.0 * np.cos(np.radians(corners[0][0]))
                steps = [np.hypot((b[0] - a[0]) * 111_320.0, (b[1] - a[1]) * east) + abs(b[2] - a[2]) for a, b in zip(corners, corners[1:], strict=False)]
                speeds = [max(one.speed_m_s, 1.0) for one in points]
                took = np.cumsum([0.0, *(step / speed for step, speed in zip(steps, speeds, strict=True))])
                took *= route.duration_s / took[-1]
                visits = []
                for number, visit in enumerate(route.visits):
                    own_points = [index for index, one in enumerate(points) if one.visit == number and one.phase.value == "inspect"]
                    visits.append({"segment": visit.segment, "reversed": visit.reversed,
                                   "from_s": float(took[own_points[0]]), "to_s": float(took[own_points[-1] + 1])})
                track = [[float(at), *corner, 100.0 - route.energy_pct * float(at) / route.duration_s] for at, corner in zip(took, corners, strict=True)]
                along = np.cumsum([0.0, *steps])
                profile = [[float(far), corner[2], 8.0 * np.sin(far / 160.0) - 4.0] for far, corner in zip(along, corners, strict=True)]
                own = [{"sortie": 0, "day": 1, "start_s": 0.0, "duration_s": route.duration_s, "energy_pct": route.energy_pct,
                        "visits": visits, "track": track}]
            found.append({"name": vehicle.name, "budget_pct": vehicle.budget_pct, "routes": own, "profile": profile})
        return found

    def network(self) -> dict[str, Any]:
        assert self.ground is not None
        network, out = self.ground.network, set((self.values or {}).get("network", {}).get("leave_out", ()))
        frame = network.frame

        def place(number: int) -> list[float]:
            one = network.pylons[number]
            return [one.lat_deg, one.lon_deg]

        return {
            "digest": str(len(network.segments)), "source": network.source,
            "frame": {"lat_deg": frame.lat_deg, "lon_deg": frame.lon_deg, "alt_m": frame.alt_m},
            "segments": [
                {"id": one.id, "name": network.segment_name(one.id), "a": place(one.a), "b": place(one.b),
                 "length_m": float(network.lengths_m[one.id]), "left_out": network.segment_name(one.id) in out, "unreachable": None}
                for one in network.segments],
            "pylons": [{"name": str(number), "place": place(number), "height_m": one.height_m} for number, one in enumerate(network.pylons)],
            "remarks": ["3 ends of lines that lay nearer than 0.5 m to each other were joined", "pylon P12 has no height: 21 m, as most have"],
        }  # fmt: skip

    def places(self) -> dict[str, Any]:
        assert self.ground is not None
        frame, values = self.ground.network.frame, self.values or {}
        pads = []
        for name in self.ground.names:
            pad = self.ground.setup.pad_of(name)
            pads.append({"vehicle": name, "place": list(frame.to_wgs84_deg(pad.east_m, pad.north_m))})
        return {
            "depot": [frame.lat_deg, frame.lon_deg], "pads": pads, "bases": [], "footprints": [],
            "alternates": [{"name": one["name"], "place": [one["lat_deg"], one["lon_deg"]]} for one in values.get("place", ()) if one["kind"] == "alternate"],
            "areas": [{"index": index, "name": one.get("name", ""), "kind": "limit" if "max_agl_m" in one else "closed",
                       "rings": [one["polygon"]], "margin_m": one.get("margin_m", 10.0), "from_file": False}
                      for index, one in enumerate(values.get("area", ())) if "polygon" in one],
        }  # fmt: skip

    def step(self, values: dict[str, Any] | None) -> None:
        self.values = values
        self.revision += 1
        self.judge()

    def edit(self, edits: list[dict[str, Any]], label: str) -> None:
        before, after = deepcopy(self.values), deepcopy(self.values)
        for one in edits:
            place: Any = after
            *way, last = one["path"] if one["op"] != "add" else (*one["path"], None)
            for number, key in enumerate(way):
                if isinstance(place, dict) and key not in place:
                    place[key] = [] if one["op"] == "add" and number == len(way) - 1 else {}
                place = place[key]
            if one["op"] == "set":
                place[last] = one["value"]
            elif one["op"] == "add":
                place.append(one["value"])
            elif isinstance(place, list):
                del place[last]
                if not place:
                    del after[way[0]]
            else:
                place.pop(last, None)
        self.undos.append((before or {}, label))
        self.redos = []
        self.step(after)


def routes_of(fake: FakePlanServer) -> list[Route]:  # noqa: C901
    async def get_workspace(_: Request) -> Response:
        return JSONResponse(fake.workspace())

    async def get_network(_: Request) -> Response:
        return JSONResponse(fake.network())

    async def get_ground(_: Request) -> Response:
        return JSONResponse(fake.places() if fake.ground else {"depot": None, "pads": [], "bases": [], "alternates": [], "areas": [], "footprints": []})

    async def post_edits(request: Request) -> Response:
        body = await request.json()
        if body["revision"] != fake.revision:
            return JSONResponse({"error": "another tab was first", **fake.workspace()}, 409)
        fake.edit(body["edits"], body["label"])
        return JSONResponse(fake.workspace())

    def mover(here: str, there: str) -> Any:
        async def move(_: Request) -> Response:
            values, label = getattr(fake, here).pop()
            getattr(fake, there).append((deepcopy(fake.values), label))
            fake.step(values)
            return JSONResponse(fake.workspace())

        return move

    async def post_plan(_: Request) -> Response:
        fake.job = {"id": "1", "kind": "plan", "state": "running", "elapsed_s": 0.0, "limit_s": 2.0, "value": None, "better_pct": 3.2, "since_s": 0.0, "error": None}

        async def work() -> None:
            assert fake.ground is not None
            ground = fake.ground
            for number, cost in enumerate((Cost.MINMAX, None)):
                wanted = replace(REQUEST, cost=cost)
                plan = await asyncio.to_thread(site_planning.plan_site, ground, wanted)
                fake.plans[f"p{number}"] = plan
                assert fake.job is not None
                fake.job |= {"elapsed_s": 1.0}
            fake.chosen = "p1"
            fake.job |= {"state": "done", "elapsed_s": 2.0}
            fake.revision += 1

        fake.work = asyncio.ensure_future(work())  # type: ignore[attr-defined]
        return JSONResponse({"job": fake.job})

    async def get_plan(request: Request) -> Response:
        return JSONResponse(fake.document(request.path_params["name"]))

    async def post_choose(request: Request) -> Response:
        fake.chosen = request.path_params["name"]
        fake.revision += 1
        return JSONResponse(fake.workspace())

    async def post_loss(request: Request) -> Response:
        body, plan = await request.json(), fake.plans[request.path_params["name"]]
        found, whole = await asyncio.to_thread(
            lambda: site_planning.preview_loss(plan, body["vehicle"], body["at_s"], cost=Cost.MINMAX, seconds=0.4, seed=1)
        )
        fake.plans["loss"] = found
        answer = {"routes": [], "uncovered": [{"segment": one, "why": "no battery left"} for one in found.uncovered],
                  "recovered": sum(len(route.visits) for route in found.routes), "complete": whole, "seconds": 0.21}  # fmt: skip
        del fake.plans["loss"]
        return JSONResponse(answer)

    async def post_try(request: Request) -> Response:
        body = await request.json()
        return JSONResponse({"answers": body["sysid"] == 1, "words": "answers: ArduPilot 4.7, 98 %" if body["sysid"] == 1 else "no answer in 3 s"})

    async def post_upload(_: Request) -> Response:
        fake.step(deepcopy(VALUES))
        return JSONResponse(fake.workspace())

    async def get_events(_: Request) -> Response:
        async def stream() -> AsyncIterator[bytes]:
            sent = ""
            while True:
                news = json.dumps({"revision": fake.revision, "job": fake.job, "tabs": 1, "chosen": fake.chosen})
                if news != sent:
                    sent = news
                    yield f"data: {news}\n\n".encode()
                await asyncio.sleep(0.1)

        return StreamingResponse(stream(), media_type="text/event-stream")

    async def get_file(request: Request) -> Response:
        name = request.path_params.get("name", "plan.html")
        file = STATIC.joinpath(name)
        if not file.is_file():
            return PlainTextResponse("there is no such file", 404)
        return Response(file.read_bytes(), media_type=TYPES.get(Path(name).suffix, "text/html; charset=utf-8"), headers={**HEADERS, "cache-control": "no-store"})

    async def get_schema(_: Request) -> Response:
        return JSONResponse(schema())

    async def get_flights(_: Request) -> Response:
        return JSONResponse([{"run": "runs/2026-11-20", "report": "/reports/1", "left": 2}])

    return [
        Route("/", get_file), Route("/files/{name}", get_file), Route("/api/workspace", get_workspace), Route("/api/schema", get_schema),
        Route("/api/network", get_network), Route("/api/ground", get_ground), Route("/api/edits", post_edits, methods=["POST"]),
        Route("/api/undo", mover("undos", "redos"), methods=["POST"]), Route("/api/redo", mover("redos", "undos"), methods=["POST"]),
        Route("/api/plan", post_plan, methods=["POST"]), Route("/api/plans/{name}", get_plan), Route("/api/plans/{name}/choose", post_choose, methods=["POST"]),
        Route("/api/plans/{name}/loss", post_loss, methods=["POST"]), Route("/api/try", post_try, methods=["POST"]),
        Route("/api/upload", post_upload, methods=["POST"]), Route("/api/flights", get_flights), Route("/api/events", get_events),
    ]  # fmt: skip


@contextmanager
def serving(fake: FakePlanServer, port: int = 0) -> Iterator[str]:
    """Serve it; yields the address."""
    config = uvicorn.Config(Starlette(routes=routes_of(fake)), host="127.0.0.1", port=port, log_level="warning", timeout_graceful_shutdown=1)
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started:
        threading.Event().wait(0.05)
    try:
        yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}/"
    finally:
        server.should_exit = True
        thread.join(5.0)


if __name__ == "__main__":
    with serving(FakePlanServer(), int(sys.argv[1])) as address:
        print(address, flush=True)
        threading.Event().wait()
