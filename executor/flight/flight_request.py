"""What is to be flown, where its record goes, and where the operator looks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from executor.adapters.clock import SystemClock
from executor.adapters.run_directory import RunDirectory, today, write_site
from executor.analysis.documents import EarlierRow
from executor.analysis.learned_document import build_learned_document
from executor.analysis.report import InjectedFault
from executor.core.context import Context
from executor.core.interface.check_codes import Check
from executor.core.interface.commands import Level
from executor.core.state.fleet_state import FleetState
from executor.flight.mqtt_settings import MqttSettings
from executor.site import site_model
from executor.site.ground_files import write_ground
from executor.site.ground_view import GroundView, view_for
from executor.site.site_file import Site
from executor.site.site_model import SiteModel
from missions import DayPlanFile, PlanFile, write_plan
from missions.readers.kept_elevation import write_kept_ground


class MessageSink(Protocol):
    """What shows the operator a line."""

    def say(self, level: Level, text: str, at_s: float | None = None) -> None:
        """Show one line; `at_s` counts from the order to take off."""
        ...


class Console(MessageSink, Protocol):
    """Where the operator looks."""

    def show_checks(self, found: Sequence[Check]) -> None:
        """Show the checklist."""
        ...

    def confirm(self, question: str) -> bool:
        """Ask while nobody has to be listened to."""
        ...

    async def ask(self, question: str) -> bool:
        """Ask beside everything else that goes on."""
        ...

    def show(self, context: Context, state: FleetState, now_s: float) -> None:
        """Show the fleet; called often, draws seldom."""
        ...

    def stop_drawing(self) -> None:
        """Stop drawing."""
        ...


@dataclass(frozen=True, slots=True)
class FlightRequest:
    """What is to be flown, and where its record goes."""

    site: Site
    base: Path
    """The folder that the site file's paths are relative to."""
    ground: SiteModel
    plan: PlanFile
    """Over all of the ground's segments, for its vehicles."""
    run: Path
    truths: Callable[[SystemClock], Sequence[InjectedFault]]
    """What really happened, asked for at the end; empty without a simulator."""
    mqtt: MqttSettings | None = None
    """Where it is published."""
    below: GroundView | None = None
    """The ground around the line, where it is read already."""
    day: DayPlanFile | None = None
    """The day whose first sorties `plan` is; None for a single flight."""
    earlier: tuple[EarlierRow, ...] = ()
    """Flights whose rest is flown."""


def write_run_start(order: FlightRequest) -> None:
    """Write the site, the first plan and the ground around the line into the run directory.

    Raises:
        BackgroundError: the picture of the ground cannot be used; nothing is written then.
    """
    below = view_for(order.ground, order.base) if order.below is None else order.below
    write_ground(order.run, below, order.ground.network.frame)
    files = {}
    if order.site.network.file != site_model.DEFAULT_NETWORK:
        files["network", "file"] = order.base / order.site.network.file
    if order.site.energy.packs is not None:
        files["energy", "packs"] = order.base / order.site.energy.packs
    for index, table in enumerate(order.site.area):
        if table.file is not None:
            files[f"area.{index}", "file"] = order.base / table.file
    if order.site.mqtt is not None and order.site.mqtt.ca_file is not None:
        files["mqtt", "ca_file"] = order.base / order.site.mqtt.ca_file
    content = order.site.model_dump(exclude_none=True, mode="json")
    if order.site.signing is not None and order.site.signing.key_file is not None:
        # The key stays where it is: a run directory is copied and handed on.
        content["signing"] = {"key_file": str((order.base / order.site.signing.key_file).resolve())}
    # What the crew sees of it is kept; the whole picture may be as large as a county.
    content.get("map", {}).pop("background", None)
    if order.ground.terrain is not None:
        # What was read, not the rasters: those may be gigabytes, and the next reading of them another.
        kept = RunDirectory(order.run).terrain
        write_kept_ground(kept, order.ground.terrain.elevation)
        content["terrain"] = {**content["terrain"], "files": kept.name}
    write_site(order.run, content, files)
    if order.ground.learned:
        build_learned_document(order.ground.learned, today()).write(RunDirectory(order.run).learned_before)
    write_plan(RunDirectory(order.run).plan_path(0), order.plan)
    if order.day is not None:
        write_plan(RunDirectory(order.run).day_plan, order.day)
