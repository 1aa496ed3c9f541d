"""Define the command that opens the plan page."""

from __future__ import annotations

import sys
import threading
import webbrowser
from contextlib import closing, suppress
from pathlib import Path
from typing import Annotated

import typer
from pydantic import ValidationError

from executor.cli.plan_inputs import check_can_write
from executor.errors import SiteError
from executor.flight.publication import read_token
from executor.plan_page import site_files
from executor.plan_page.server import PlanServer
from executor.plan_page.site_store import SiteStore
from executor.plan_page.worker import Worker, make_reader
from executor.site.mqtt_and_web_keys import WebTable
from executor.supervised import InternalErrorReporter
from missions import format_first_error

USUAL_SITE = "site.toml"


def open_page(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="[SITE|NETWORK|PLAN]",
            help="A site file; a network, for which a new site is made; or a plan next to its site. By default "
            "site.toml of this folder, if there is one.",
        ),
    ] = None,
    host: Annotated[
        str,
        typer.Option(metavar="ADDRESS", help="Address to listen on; any but this computer's own needs --token-env."),
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on; 0 for a free one.")] = 0,
    token_env: Annotated[
        str | None, typer.Option(metavar="NAME", help="Environment variable with the token that browsers must show.")
    ] = None,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Print the address only.")] = False,
) -> None:
    """Plan on a map in the browser: the page edits the site file and its plans; ends with Ctrl-C."""
    try:
        table = WebTable(host=host, port=port, token_env=token_env)
    except ValidationError as error:
        raise SiteError(f"--{format_first_error(error)}".replace("_", "-", 1)) from error
    token = read_token(table)
    with closing(make_reader()) as reader:
        site = None if file is None else _find_site(file, reader)
        if file is None and Path(USUAL_SITE).is_file():
            site = Path(USUAL_SITE)
        root = Path() if site is None or site.absolute().is_relative_to(Path.cwd()) else site.parent
        mistakes = InternalErrorReporter(_report_error, lambda _: None)

        def report(what: str, error: BaseException) -> None:
            mistakes(None, {"message": what, "exception": error, "said": False})

        with PlanServer(table, token, root, None if site is None else SiteStore(site), report, reader) as server:
            query = "" if token is None else f"?token={token}"
            print(f"page: {server.address}" + ("" if token is None else f"?token=${token_env}"), flush=True)
            if not no_browser:
                webbrowser.open(server.address + query)
            with suppress(KeyboardInterrupt):
                threading.Event().wait()


def _find_site(file: Path, reader: Worker) -> Path:
    """Return the site file for a file to open; for a network one is made, by the process that reads it later."""
    if not file.is_file():
        raise SiteError(f"{file}: no such file; expected a site, a network or a plan")
    kind = site_files.find_kind(file)
    if kind == "plan":
        return site_files.find_site_of_plan(file)
    if kind == "site":
        return file
    check_can_write(file.parent / USUAL_SITE)
    site = reader.submit(site_files.make_site, file.parent, file).result()
    print(f"{site}: a new site for {file}", flush=True)
    return site


def _report_error(line: str) -> None:
    print(f"faultline: {line}", file=sys.stderr, flush=True)
