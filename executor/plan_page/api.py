"""The plan page's HTTP API; FastAPI writes its OpenAPI description."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, Literal

from fastapi import FastAPI, Query, Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, Field
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import JSONResponse, Response

from executor.adapters.run_directory import RunDirectory
from executor.adapters.web.page_server import TYPES
from executor.errors import ExecutorError, SiteError
from executor.plan_page import api_answers as answers
from executor.plan_page import flights, site_files
from executor.plan_page.plan_work import Change, PlanSettings
from executor.plan_page.planning import Superseded
from executor.plan_page.site_document import Edit, EditRefused
from executor.plan_page.site_store import SiteStore
from executor.plan_page.try_connection import listen_for_vehicle
from executor.plan_page.workspace import StaleRevision, Workspace
from executor.site.ground_view import DOCUMENT
from executor.site.site_keys import AutopilotKey
from executor.site.site_schema import build_site_schema
from missions import MissionsError
from missions.files import json_text
from planner import PlannerError

MOST_EDITS = 1000
Revision = Annotated[int, Field(description="Of the workspace that the change is meant for.")]


class Body(BaseModel):
    """Body of a request."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class EditsBody(Body):
    """Changes of the site file that form one step of undo."""

    revision: Revision
    edits: Annotated[tuple[Edit, ...], Field(min_length=1, max_length=MOST_EDITS)]
    label: Annotated[str, Field(max_length=200)] = "edit"
    """Name of the edit in the undo menu."""


class RevisionBody(Body):
    """Revision of the workspace."""

    revision: Revision


class OpenBody(Body):
    """File on this computer, below the folder where the page was started."""

    path: Annotated[str, Field(min_length=1, max_length=1000)]
    """A site, a network or a plan; `default` for the network that comes with faultline."""


class PlanBody(PlanSettings):
    """Plan to make."""

    revision: Revision


class JobBody(Body):
    """Job to cancel."""

    job: Annotated[str, Field(max_length=20)]


class LossBody(Body):
    """Loss to evaluate."""

    vehicle: Annotated[str, Field(max_length=32)]
    at_s: Annotated[float, Field(ge=0, le=1e7)]
    """Seconds from the start of the plan; for days, from the first midnight."""


class ChangesBody(Body):
    """Changes of a plan by hand."""

    changes: Annotated[tuple[Change, ...], Field(min_length=1, max_length=MOST_EDITS)]
    keep: bool = False
    """Whether to choose the new plan."""


class TryBody(Body):
    """Connection to listen on."""

    connection: Annotated[str, Field(max_length=300)]
    sysid: Annotated[int, Field(ge=1, le=254)]
    autopilot: AutopilotKey


class FlyBody(Body):
    """Plan to fly."""

    plan: Annotated[str, Field(max_length=20)]
    dry: bool = False
    """Run the checklist alone."""


class LeftBody(Body):
    """Flight whose left-over segments are planned."""

    run: Annotated[str, Field(max_length=200)]
    seconds: Annotated[float, Field(ge=0.1, le=86_400)] = 5.0


class JsonBytes(Response):
    """JSON that is already encoded."""

    media_type = "application/json"


def answer_of(kind: type[BaseModel]) -> dict[int | str, dict[str, Any]]:
    """Return the documentation of a path's responses."""
    return {
        200: {"model": kind}, 409: {"model": answers.StaleAnswer}, 422: {"model": answers.ErrorAnswer}
    }  # fmt: skip


def refuse(text: str, status: int, headers: Mapping[str, str] | None = None, **more: object) -> Response:
    """Return the response to a refused request: one line, and the key that it is about."""
    return JSONResponse({"error": text, "path": None, **more}, status, headers)


def build_api(workspace: Workspace) -> FastAPI:
    """Return the application, without its guard."""
    api = FastAPI(
        title="faultline plan page", version="1", docs_url=None, redoc_url=None, openapi_url="/api/openapi.json",
        description="What the plan page asks of `faultline open`. Places are [latitude, longitude] in degrees.",
    )  # fmt: skip
    _add_error_answers(api, workspace)
    _add_questions(api, workspace)
    _add_changes(api, workspace)
    _add_planning(api, workspace)
    _add_flights(api, workspace)
    return api


def _add_error_answers(api: FastAPI, workspace: Workspace) -> None:
    async def answer_ours(_: Request, error: Exception) -> Response:
        if isinstance(error, EditRefused):
            return refuse(str(error), 422, path=error.path)
        if isinstance(error, StaleRevision):
            return refuse(str(error), 409, workspace=workspace.describe())
        return refuse(str(error), 409 if isinstance(error, Superseded) else 422)

    async def answer_wrong_body(_: Request, error: Exception) -> Response:
        found = error.errors()[0] if isinstance(error, RequestValidationError) else {"loc": (), "msg": "?"}
        place = [part for part in found["loc"] if part != "body"]
        reason = str(found["msg"]).removeprefix("Value error, ")
        return refuse(": ".join([".".join(map(str, place)) or "body", reason]), 422)

    async def answer_http(_: Request, error: Exception) -> Response:
        return refuse(error.detail, error.status_code) if isinstance(error, HTTPException) else refuse("cut short", 400)

    for kind in (ExecutorError, MissionsError, PlannerError):
        api.add_exception_handler(kind, answer_ours)
    api.add_exception_handler(RequestValidationError, answer_wrong_body)
    api.add_exception_handler(HTTPException, answer_http)
    api.add_exception_handler(ClientDisconnect, answer_http)


def _add_questions(api: FastAPI, workspace: Workspace) -> None:
    @api.get("/api/workspace", responses=answer_of(answers.WorkspaceAnswer))
    async def get_workspace() -> Response:
        """Return the site, its problems, its plans and the running job."""
        return JsonBytes(json_text(workspace.describe()))

    @api.get("/api/schema")
    async def get_schema() -> Response:
        """Return the JSON schema of the site file; keys have `description`, `default` and `unit`."""
        return JsonBytes(_write_schema())

    @api.get("/api/network", responses=answer_of(answers.NetworkAnswer))
    async def get_network() -> Response:
        """Return the network as read: spans, pylons and repairs."""
        return _answer_bytes(workspace.view.network, "no network is known")

    @api.get("/api/ground", responses=answer_of(answers.GroundAnswer))
    async def get_ground() -> Response:
        """Return depot, pads, bases, places, areas and camera footprints."""
        return _answer_bytes(workspace.view.ground, "nothing is known of the ground")

    @api.get("/api/background")
    async def get_background() -> Response:
        """Return the background of the map, in the form of `ground.json` in a run directory."""
        return _answer_bytes(workspace.view.background.get(DOCUMENT), "nothing is known of the ground")

    @api.get("/api/background/{name}")
    async def get_background_file(name: str) -> Response:
        """Return a picture of the background."""
        found = workspace.view.background.get(name)
        if found is None:
            raise HTTPException(404, "there is no such picture")
        return Response(found, media_type=TYPES["." + name.rpartition(".")[2]])

    @api.get("/api/files", responses=answer_of(answers.FilesAnswer))
    async def get_files() -> Response:
        """Return the files that can be opened in the folder where the page was started."""
        found = site_files.list_files(workspace.root)
        return JSONResponse({"files": [{"path": path, "kind": kind} for path, kind in found]})


@cache
def _write_schema() -> str:
    return json_text(build_site_schema())


def _answer_bytes(content: bytes | None, missing: str) -> Response:
    if content is None:
        raise HTTPException(404, missing)
    return JsonBytes(content)


def _add_changes(api: FastAPI, workspace: Workspace) -> None:
    async def answer(**more: object) -> Response:
        await workspace.wait_until_checked()
        return JsonBytes(json_text(workspace.describe() | more))

    @api.post("/api/edits", responses=answer_of(answers.WorkspaceAnswer))
    async def post_edits(body: EditsBody) -> Response:
        """Apply edits to the site file as one step of undo; 409 if the site has changed meanwhile."""
        await workspace.change(body.revision, lambda store: store.edit(body.label, body.edits))
        return await answer()

    @api.post("/api/undo", responses=answer_of(answers.WorkspaceAnswer))
    async def post_undo(body: RevisionBody) -> Response:
        """Undo the last step."""
        await workspace.change(body.revision, SiteStore.undo)
        return await answer()

    @api.post("/api/redo", responses=answer_of(answers.WorkspaceAnswer))
    async def post_redo(body: RevisionBody) -> Response:
        """Redo the last undone step."""
        await workspace.change(body.revision, SiteStore.redo)
        return await answer()

    @api.post("/api/open", responses=answer_of(answers.WorkspaceAnswer))
    async def post_open(body: OpenBody) -> Response:
        """Open a site; a network starts a new one, a plan opens the site next to it."""
        named = None if body.path == "default" else site_files.find_inside(workspace.root, body.path)
        await workspace.open_file(named)
        return await answer()

    @api.post("/api/upload", responses=answer_of(answers.WorkspaceAnswer))
    async def post_upload(
        request: Request, name: Annotated[str, Query(max_length=200)], use: Literal["network", "file"] = "network"
    ) -> Response:
        """Store the body as a file next to the site. A network starts a new site; edits name other files."""
        kept = await workspace.upload(name, request.stream(), as_network=use == "network")
        return await answer(uploaded=kept)


def _add_planning(api: FastAPI, workspace: Workspace) -> None:
    planning = workspace.planning

    @api.post("/api/plan", responses=answer_of(answers.JobAnswer))
    async def post_plan(body: PlanBody) -> Response:
        """Start planning; the event stream reports progress. A plan that is not one of several is chosen at once."""
        workspace.expect_revision(body.revision)
        return JSONResponse({"job": planning.start(workspace.now, body).describe()})

    @api.post("/api/cancel", responses=answer_of(answers.WorkspaceAnswer))
    async def post_cancel(body: JobBody) -> Response:
        """Cancel a job; its results are dropped."""
        await planning.cancel(body.job)
        return JsonBytes(json_text(workspace.describe()))

    @api.get("/api/plans/{plan}", responses=answer_of(answers.PlanPart))
    async def get_plan(plan: str) -> Response:
        """Return a plan: each vehicle's position and battery over time, what is left over, and its heights."""
        return JsonBytes(json_text(await planning.show(workspace.now, plan)))

    @api.post("/api/plans/{plan}/choose", responses=answer_of(answers.WorkspaceAnswer))
    async def post_choose(plan: str) -> Response:
        """Write a plan to the file next to the site that is flown."""
        await planning.choose(workspace.now, plan)
        return JsonBytes(json_text(workspace.describe()))

    @api.post("/api/plans/{plan}/loss", responses=answer_of(answers.LossAnswer))
    async def post_loss(plan: str, body: LossBody) -> Response:
        """Return the survivors' routes if a vehicle were lost; 409 if a newer request arrived meanwhile."""
        return JsonBytes(json_text(await planning.preview_loss(workspace.now, plan, body.vehicle, body.at_s)))

    @api.post("/api/plans/{plan}/change", responses=answer_of(answers.ChangeAnswer))
    async def post_change(plan: str, body: ChangesBody) -> Response:
        """Change a plan by hand: the new one is checked and priced, and stored along with the old one."""
        return JsonBytes(json_text(await planning.change(workspace.now, plan, body.changes, keep=body.keep)))


REPORT = (
    "sandbox allow-scripts; default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'"
)
"""Content policy of a served report: one file with its style and script inside. It gets an opaque origin and may fetch
nothing, so that it cannot change this server's site."""
SCRIPT = re.compile(rb"script-src '(sha256-[A-Za-z0-9+/]{43}=)'")
HEAD = 4096
"""Leading bytes of a report that hold the hash of its script."""


def _add_flights(api: FastAPI, workspace: Workspace) -> None:
    @api.post("/api/try", responses=answer_of(answers.TryAnswer))
    async def post_try(body: TryBody) -> Response:
        """Listen for a vehicle on a connection for some seconds; nothing is sent."""
        try:
            return JSONResponse(await listen_for_vehicle(body.connection, body.sysid, body.autopilot))
        except ValueError as error:
            raise SiteError(f"connection: {error}") from error

    @api.post("/api/fly", responses=answer_of(answers.FlightAnswer))
    async def post_fly(body: FlyBody) -> Response:
        """Start a flight of a plan with its own page, which asks before anything takes off; `url` leads there."""
        site, plan = await workspace.choose_for_flight(body.plan)
        work = flights.run_checklist if body.dry else flights.start_flight
        return JSONResponse(await work(workspace.root, site, plan))

    @api.get("/api/flights", responses=answer_of(answers.FlightsAnswer))
    def get_flights() -> Response:
        """Return the flights of the folder where the page was started, newest first."""
        return JSONResponse({"flights": list(flights.list_flights(workspace.root))})

    @api.get("/api/report")
    def get_report(run: Annotated[str, Query(max_length=200)]) -> Response:
        """Return the report of a flight, as a sandboxed page."""
        page = RunDirectory(flights.find_run(workspace.root, run)).page
        if not page.is_file():
            raise HTTPException(404, "there is no report yet")
        content = page.read_bytes()
        script = SCRIPT.search(content, 0, HEAD)
        policy = REPORT if script is None else f"{REPORT}; script-src '{script[1].decode()}'"
        return Response(content, 200, {"content-security-policy": policy}, "text/html; charset=utf-8")

    @api.post("/api/left", responses=answer_of(answers.JobAnswer))
    async def post_left(body: LeftBody) -> Response:
        """Start planning the segments that a flight left over."""
        run = flights.find_run(workspace.root, body.run)
        job = workspace.planning.start(workspace.now, PlanSettings(seconds=body.seconds), run)
        return JSONResponse({"job": job.describe()})
