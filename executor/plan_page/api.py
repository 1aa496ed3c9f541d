"""What the plan page asks of its server; FastAPI says in OpenAPI what there is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from fastapi import FastAPI, Query, Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, Field
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import JSONResponse, Response

from executor.adapters.web.page_server import TYPES
from executor.errors import ExecutorError
from executor.plan_page import site_files
from executor.plan_page.site_document import Edit, EditRefused, Operation
from executor.plan_page.workspace import StaleRevision, Workspace
from executor.site.ground_view import DOCUMENT
from executor.site.site_schema import build_site_schema
from missions import MissionsError
from missions.files import json_text
from planner import PlannerError

MOST_EDITS = 1000
Key = Annotated[str, Field(max_length=200)] | Annotated[int, Field(ge=0, le=1_000_000)]
Revision = Annotated[int, Field(description="Of the workspace that the change is meant for.")]


class Body(BaseModel):
    """What is sent."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class EditBody(Body):
    """One change of the site file."""

    op: Operation
    path: Annotated[tuple[Key, ...], Field(min_length=1, max_length=12)]
    """Keys, and numbers in lists, from the whole file down."""
    value: Any = None
    """Of `set` and `add`."""
    at: Annotated[int, Field(ge=0)] | None = None
    """With `add`: before which one; without it at the end."""


class EditsBody(Body):
    """Changes of the site file that are one step of undo."""

    revision: Revision
    edits: Annotated[tuple[EditBody, ...], Field(min_length=1, max_length=MOST_EDITS)]
    label: Annotated[str, Field(max_length=200)] = "edit"
    """What undo calls it."""


class RevisionBody(Body):
    """Of which workspace."""

    revision: Revision


class OpenBody(Body):
    """A file on this computer, below the folder where the page was started."""

    path: Annotated[str, Field(min_length=1, max_length=1000)]
    """A site, a network or a plan; `default` for the network that comes with faultline."""


class JsonBytes(Response):
    """JSON that is made already."""

    media_type = "application/json"


def refuse(text: str, status: int, headers: Mapping[str, str] | None = None, **more: object) -> Response:
    """Return the answer to what is not done: one line, and the key that it is about."""
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
    return api


def _add_error_answers(api: FastAPI, workspace: Workspace) -> None:
    async def answer_ours(_: Request, error: Exception) -> Response:
        path = list(error.path) if isinstance(error, EditRefused) else None
        return JSONResponse({"error": str(error), "path": path}, 422)

    async def answer_stale(_: Request, error: Exception) -> Response:
        return JSONResponse({"error": str(error), "path": None, "workspace": workspace.describe()}, 409)

    async def answer_wrong_body(_: Request, error: Exception) -> Response:
        found = error.errors()[0] if isinstance(error, RequestValidationError) else {"loc": (), "msg": "?"}
        place = [part for part in found["loc"] if part != "body"]
        reason = str(found["msg"]).removeprefix("Value error, ")
        return JSONResponse({"error": ": ".join([".".join(map(str, place)) or "body", reason]), "path": None}, 422)

    async def answer_http(_: Request, error: Exception) -> Response:
        status, text = (error.status_code, error.detail) if isinstance(error, HTTPException) else (400, "cut short")
        return JSONResponse({"error": text, "path": None}, status)

    for kind in (ExecutorError, MissionsError, PlannerError):
        api.add_exception_handler(kind, answer_ours)
    api.add_exception_handler(StaleRevision, answer_stale)
    api.add_exception_handler(RequestValidationError, answer_wrong_body)
    api.add_exception_handler(HTTPException, answer_http)
    api.add_exception_handler(ClientDisconnect, answer_http)


def _add_questions(api: FastAPI, workspace: Workspace) -> None:
    @api.get("/api/workspace")
    async def get_workspace() -> Response:
        """Return the site, what is wrong with it, its plans and the job under way."""
        return JsonBytes(json_text(workspace.describe()))

    @api.get("/api/schema")
    async def get_schema() -> Response:
        """Return the JSON schema of the site file; keys have `description`, `default` and `unit`."""
        return JsonBytes(json_text(build_site_schema()))

    @api.get("/api/network")
    async def get_network() -> Response:
        """Return the network as it was understood: spans, pylons and what was mended."""
        return _answer_bytes(workspace.view.network, "no network is known")

    @api.get("/api/ground")
    async def get_ground() -> Response:
        """Return depot, pads, bases, places, areas and what cameras see."""
        return _answer_bytes(workspace.view.ground, "nothing is known of the ground")

    @api.get("/api/background")
    async def get_background() -> Response:
        """Return what lies below the line, as `ground.json` of a run directory has it."""
        return _answer_bytes(workspace.view.background.get(DOCUMENT), "nothing is known of the ground")

    @api.get("/api/background/{name}")
    async def get_background_file(name: str) -> Response:
        """Return a picture that the background names."""
        found = workspace.view.background.get(name)
        if found is None:
            raise HTTPException(404, "there is no such picture")
        return Response(found, media_type=TYPES["." + name.rpartition(".")[2]])

    @api.get("/api/files")
    async def get_files() -> Response:
        """Return what could be opened in the folder where the page was started."""
        found = site_files.list_files(workspace.root)
        return JSONResponse({"files": [{"path": path, "kind": kind} for path, kind in found]})


def _answer_bytes(content: bytes | None, missing: str) -> Response:
    if content is None:
        raise HTTPException(404, missing)
    return JsonBytes(content)


def _add_changes(api: FastAPI, workspace: Workspace) -> None:
    async def answer(**more: object) -> Response:
        await workspace.wait_until_checked()
        return JsonBytes(json_text(workspace.describe() | more))

    @api.post("/api/edits")
    async def post_edits(body: EditsBody) -> Response:
        """Do edits of the site file as one step of undo; 409 where the site is another one by now."""
        edits = [Edit(one.op, one.path, one.value, one.at) for one in body.edits]
        await workspace.edit(body.revision, body.label, edits)
        return await answer()

    @api.post("/api/undo")
    async def post_undo(body: RevisionBody) -> Response:
        """Undo the last step."""
        await workspace.undo(body.revision)
        return await answer()

    @api.post("/api/redo")
    async def post_redo(body: RevisionBody) -> Response:
        """Do again what was undone last."""
        await workspace.redo(body.revision)
        return await answer()

    @api.post("/api/open")
    async def post_open(body: OpenBody) -> Response:
        """Open a site; a network begins a new one, a plan opens the site beside it."""
        if body.path == "default":
            await workspace.open_default()
        else:
            await workspace.open_file(site_files.find_inside(workspace.root, body.path))
        return await answer()

    @api.post("/api/upload")
    async def post_upload(
        request: Request, name: Annotated[str, Query(max_length=200)], use: Literal["network", "file"] = "network"
    ) -> Response:
        """Keep the file of the body beside the site. A network begins a new site; other files are named by edits."""
        kept = await workspace.upload(name, request.stream(), as_network=use == "network")
        return await answer(uploaded=kept)
