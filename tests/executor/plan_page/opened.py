"""A plan page that listens, for tests."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import jsonschema

from executor.plan_page.server import PlanServer
from executor.plan_page.site_files import make_site
from executor.plan_page.site_store import SiteStore
from executor.site.mqtt_and_web_keys import WebTable
from tests.patience import PATIENCE_S

DEMO_RADIUS = "radius_m = 600"


@dataclass
class Opened:
    """A page that is open, and one who talks to it."""

    server: PlanServer
    client: httpx.Client
    mistakes: list[str] = field(default_factory=list)
    api: dict[str, Any] = field(default_factory=dict)

    @property
    def port(self) -> int:
        return int(self.server.address.rstrip("/").rpartition(":")[2])

    def get(self, path: str) -> Any:
        return self._check(path, "get", self.client.get(path))

    def _check(self, path: str, method: str, answer: httpx.Response) -> Any:
        """Return an answer once it is what the API's documentation says."""
        document: Any = answer.json()
        if not self.api:
            self.api.update(self.client.get("/api/openapi.json").json())
        plain = re.sub(r"/plans/[^/]+", "/plans/{plan}", path.partition("?")[0])
        said = self.api["paths"].get(plain, {}).get(method, {}).get("responses", {}).get(str(answer.status_code))
        schema = {} if said is None else said["content"]["application/json"]["schema"]
        jsonschema.validate(document, {**schema, "components": self.api["components"]})
        return document

    def post(self, path: str, status: int = 200, **body: Any) -> Any:
        answer = self.client.post(path, json=body)
        assert answer.status_code == status, answer.text
        return self._check(path, "post", answer)

    def open(self, path: str, status: int = 200) -> Any:
        answer = self.client.post("/api/open", json={"path": path})
        assert answer.status_code == status, answer.text
        return answer.json()

    def edit(self, *edits: Mapping[str, object], status: int = 200) -> Any:
        return self.post("/api/edits", status, revision=self.get("/api/workspace")["revision"], edits=edits)

    def set(self, *path: str | int, value: object, status: int = 200) -> Any:
        return self.edit({"op": "set", "path": path, "value": value}, status=status)

    @property
    def root(self) -> Path:
        return self.server._root

    def follow_until(self, is_so: Callable[[Any], bool]) -> Any:
        """Follow the stream until it says so, and return the workspace."""
        with self.client.stream("GET", "/api/events") as stream:
            for line in stream.iter_lines():
                if line.startswith("data: ") and is_so(json.loads(line.removeprefix("data: "))):
                    return self.get("/api/workspace")
        raise AssertionError("the stream ended before")

    def follow(self, key: str, value: object) -> Any:
        return self.follow_until(lambda news: news[key] == value)

    def follow_job(self, job: str) -> Any:
        return self.follow_until(lambda news: news["job"]["id"] == job and news["job"]["state"] != "running")

    def end_job(self) -> None:
        """Cancel what is still planned, and look whether everything went well so far."""
        job = self.get("/api/workspace")["job"]
        if job is not None and job["state"] == "running":
            self.post("/api/cancel", job=job["id"])
        assert self.mistakes == []

    def checked(self) -> Any:
        """Return the workspace once its site is understood."""
        return self.follow_until(lambda news: news["checked"] == news["revision"])


@contextmanager
def opened(root: Path, site: Path | None, token: str | None = None, port: int = 0) -> Iterator[Opened]:
    mistakes: list[str] = []
    server = PlanServer(
        WebTable(port=port), token, root, None if site is None else SiteStore(site),
        lambda what, error: mistakes.append(f"{what}: {type(error).__name__}: {error}"),
    )  # fmt: skip
    with server, httpx.Client(base_url=server.address, timeout=PATIENCE_S) as client:
        yield Opened(server, client, mistakes)
    assert mistakes == []


def make_demo_site(folder: Path, *more: str) -> Path:
    """Write a site over a part of the network that comes with faultline."""
    site = make_site(folder, None)
    text = site.read_text().replace('file = "default"', f'file = "default"\n{DEMO_RADIUS}')
    site.write_text("\n".join([text, *more]))
    return site
