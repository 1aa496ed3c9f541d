"""Keep the inputs of a flight: plan, consoles, and the documents in its run directory."""

from __future__ import annotations

import os
import shutil
import ssl
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from secrets import token_hex
from typing import Any, Protocol

import tomlkit

import missions
from executor.adapters.clock import SystemClock
from executor.adapters.mqtt.intent_intake import IntakeRules
from executor.adapters.mqtt.topics import BrokerAddress, MqttTopics
from executor.adapters.run_directory import RunDirectory, today
from executor.analysis.documents import AskedVehicle, AskedVehicles, EarlierRow, read_flown_day_plan
from executor.analysis.report import InjectedFault
from executor.core import fleet_step
from executor.core.context import Context
from executor.core.interface.codes import Check
from executor.core.interface.commands import Level
from executor.core.preflight.onboard_failsafes import LinkFailsafe, read_link_failsafe
from executor.core.state.fleet_state import FleetState
from executor.core.state.onboard_fence import build_first_fences
from executor.core.state.vehicle_parts import OnboardMission
from executor.core.state.vehicle_state import build_onboard_mission
from executor.errors import SiteError
from executor.site import day_plans, site_model
from executor.site.ground_view import GroundView, view_for, write_ground
from executor.site.learned_files import LearnedDocument, build_learned_document
from executor.site.mqtt_and_web_keys import MqttTable
from executor.site.site_file import Site, read_secret, read_site
from executor.site.site_planning import check_plan_belongs
from missions.files import write_whole
from missions.readers.elevation_rasters import write_kept_ground


class MessageSink(Protocol):
    """Sink of lines for the operator."""

    def say(self, level: Level, text: str, at_s: float | None = None) -> None:
        """Show one line; `at_s` counts from the order to take off."""


class Console(MessageSink, Protocol):
    """The operator's console."""

    def show_checks(self, found: Sequence[Check]) -> None:
        """Show the checklist."""

    async def ask(self, question: str) -> bool:
        """Ask a question while everything else continues."""

    def show(self, context: Context, state: FleetState, now_s: float) -> None:
        """Show the fleet; called often, redraws at intervals."""

    def stop_drawing(self) -> None:
        """Stop drawing."""


@dataclass(frozen=True, slots=True)
class MqttSettings:
    """MQTT settings of a site."""

    topics: MqttTopics
    broker: BrokerAddress
    rules: IntakeRules
    period_s: float
    """Telemetry period in real seconds."""
    exposed: bool
    """Whether secrets leave this computer without TLS."""
    clear: bool = False
    """Whether to clear the flight's retained messages at the end."""


def read_mqtt_settings(
    table: MqttTable | None, base: Path, source: str, environment: Mapping[str, str] = os.environ
) -> MqttSettings | None:
    """Return a site's MQTT settings, with the secrets that it names; None if it has none.

    Args:
        table: Table of the site file.
        base: Folder to which the site file's paths are relative.
        source: Site file, for messages.
        environment: Source of the secrets.

    Raises:
        SiteError: a secret is not set, or a certificate or its key cannot be used.
    """
    if table is None:
        return None
    broker = BrokerAddress(
        table.host,
        table.used_port,
        # The same for every connection of this flight, and unique to it.
        f"faultline-{token_hex(6)}",
        read_secret(table.username_env, "mqtt.username_env", source, environment),
        read_secret(table.password_env, "mqtt.password_env", source, environment),
        _build_tls_context(table, base, source, environment),
        table.protocol,
        table.websocket_path,
    )
    token = (environment.get(table.token_env) if table.token_env is not None else None) or None
    exposed = not table.is_here and not table.tls and (token, broker.username, broker.password) != (None, None, None)
    return MqttSettings(
        MqttTopics(table.prefix), broker, _build_rules(table, token), 1.0 / table.telemetry_rate_hz, exposed,
        table.clear_retained,
    )  # fmt: skip


def _build_rules(table: MqttTable, token: str | None) -> IntakeRules:
    closed = ""
    if token is None and table.token_env is not None:
        closed = f"the environment variable {table.token_env} is not set"
    elif token is None and not table.is_here:
        closed = "the broker is not on this computer, and the site names no token_env"
    return IntakeRules(table.intent_max_age_s, token, closed)


def _build_tls_context(
    table: MqttTable, base: Path, source: str, environment: Mapping[str, str]
) -> ssl.SSLContext | None:
    if not table.tls:
        return None
    try:
        made = ssl.create_default_context(cafile=None if table.ca_file is None else str(base / table.ca_file))
    except (OSError, ssl.SSLError) as error:
        why = error.strerror or type(error).__name__
        text = f"{source}: mqtt.ca_file: expected a certificate (PEM) in {table.ca_file}: {why}"
        raise SiteError(text) from error
    if table.cert_file is None:
        return made
    key = None if table.key_file is None else base / table.key_file
    password = read_secret(table.key_password_env, "mqtt.key_password_env", source, environment) or ""
    try:
        # Without a password OpenSSL would prompt for one in the terminal.
        made.load_cert_chain(base / table.cert_file, key, password=lambda: password)
    except (OSError, ssl.SSLError) as error:
        files = table.cert_file if table.key_file is None else f"{table.cert_file} and {table.key_file}"
        why = getattr(error, "reason", None) or error.strerror or type(error).__name__
        text = f"{source}: mqtt.cert_file: expected a certificate and its private key (PEM) in {files}: {why}"
        raise SiteError(text) from error
    return made


@dataclass(frozen=True, slots=True)
class FlightRequest:
    """Flight to fly, and where to record it."""

    site: Site
    base: Path
    """Folder to which paths in the site file are relative."""
    ground: site_model.SiteModel
    plan: missions.PlanFile
    """Plan over all segments of the site, for its vehicles."""
    run: Path
    truths: Callable[[SystemClock], Sequence[InjectedFault]]
    """Injected faults, read at the end; empty without a simulator."""
    mqtt: MqttSettings | None = None
    """MQTT settings, if it is published."""
    below: GroundView | None = None
    """Ground around the line, if already read."""
    day: missions.DayPlanFile | None = None
    """Day plan whose first sorties `plan` holds; None for a single flight."""
    earlier: tuple[EarlierRow, ...] = ()
    """Earlier flights whose remainder is flown."""


def write_run_start(request: FlightRequest) -> None:
    """Write the site, the first plan and the ground around the line into the run directory.

    Raises:
        BackgroundError: the picture of the ground cannot be used; nothing is written then.
    """
    below = view_for(request.ground, request.base) if request.below is None else request.below
    write_ground(request.run, below, request.ground.network.frame)
    content = request.site.model_dump(exclude_none=True, mode="json")
    if request.site.network.file != site_model.DEFAULT_NETWORK:
        _keep_file(request, content["network"], "file", "network")
    if request.site.energy.packs is not None:
        _keep_file(request, content["energy"], "packs", "energy")
    for index, table in enumerate(content["area"]):
        if "file" in table:
            _keep_file(request, table, "file", f"area{index}")
    if request.site.mqtt is not None and request.site.mqtt.ca_file is not None:
        _keep_file(request, content["mqtt"], "ca_file", "mqtt")
    _keep_places_of_keys(request, content)
    # The shown part is kept; the whole picture may cover a county.
    content.get("map", {}).pop("background", None)
    if request.ground.terrain is not None:
        # The heights as read, not the rasters: those may be gigabytes, and may read differently next time.
        kept = RunDirectory(request.run).terrain
        write_kept_ground(kept, request.ground.terrain.elevation)
        content["terrain"]["files"] = kept.name
    write_whole(RunDirectory(request.run).site, tomlkit.dumps(content).encode())
    if request.ground.learned:
        build_learned_document(request.ground.learned, today()).write(RunDirectory(request.run).learned_before)
    missions.write_plan(RunDirectory(request.run).plan_path(0), request.plan)
    if request.day is not None:
        missions.write_plan(RunDirectory(request.run).day_plan, request.day)


def _keep_file(request: FlightRequest, table: dict[str, Any], key: str, name: str) -> None:
    """Copy a file named in the site file into the run directory, which may be moved elsewhere, and update its name."""
    file = request.base / table[key]
    table[key] = f"{name}{file.suffix}"
    shutil.copyfile(file, request.run / table[key])


def _keep_places_of_keys(request: FlightRequest, content: dict[str, Any]) -> None:
    """Make the paths of keys absolute: keys stay in place, as a run directory is copied and shared."""
    for table, key in (("signing", "key_file"), ("mqtt", "cert_file"), ("mqtt", "key_file")):
        if key in content.get(table, {}):
            content[table][key] = str((request.base / content[table][key]).resolve())


@dataclass(frozen=True, slots=True)
class RunStart:
    """A flight before its launch."""

    ground: site_model.SiteModel
    plan: missions.PlanFile
    context: Context
    state: FleetState


def read_run_start(run: Path) -> RunStart:
    """Return the initial data of a flight.

    Raises:
        LogError: vehicles.json cannot be used.
        SiteError: site.toml cannot be used.
        MissionsError: the first plan, or the network, cannot be used.
    """
    return build_run_start(run, *read_site_and_plan(run))


def read_site_and_plan(run: Path) -> tuple[site_model.SiteModel, missions.PlanFile]:
    """Return the site of a flight and its first plan.

    Raises:
        SiteError: site.toml cannot be used.
        MissionsError: the first plan, or the network, cannot be used.
    """
    kept = RunDirectory(run)
    learned = LearnedDocument.read(kept.learned_before).known_by_name if kept.learned_before.exists() else {}
    ground = site_model.load_site_model(read_site(kept.site), run, learned)
    plan = missions.read_plan(kept.plan_path(0))
    check_plan_belongs(plan, ground, str(kept.plan_path(0)))
    return ground, plan


def build_run_start(run: Path, ground: site_model.SiteModel, plan: missions.PlanFile) -> RunStart:
    """Return the initial data of a flight, as `read_run_start`."""
    answers = AskedVehicles.read(RunDirectory(run).vehicles)
    rows = {row.name: row for row in answers.vehicles}
    pads = _build_pads(rows, ground.names)
    setup = ground.setup if pads is None else replace(ground.setup, pads=tuple(pads))
    dialects = {table.name: missions.dialect_for(table.autopilot) for table in ground.site.vehicle}
    parameters = {name: row.parameters for name, row in rows.items() if name in dialects}
    own = {name: read_link_failsafe(dialects[name], known) for name, known in parameters.items()}
    day = read_flown_day_plan(run)
    context, boards = build_context_and_boards(ground, setup, plan, day, own, parameters)
    if context.day is not None and not answers.counts_packs:
        context = replace(context, day=replace(context.day, packs={}))
    ahead = {} if day is None else day_plans.sorties_ahead_of(day)
    return RunStart(
        ground,
        plan,
        context,
        fleet_step.build_initial_state(boards, fences=build_first_fences(context, boards), ahead=ahead),
    )


def build_context_and_boards(
    ground: site_model.SiteModel,
    setup: missions.FlightSetup,
    plan: missions.PlanFile,
    day: missions.DayPlanFile | None,
    own: Mapping[str, LinkFailsafe],
    parameters: Mapping[str, Mapping[str, float]],
) -> tuple[Context, dict[str, OnboardMission | None]]:
    """Return the context of a flight, and each vehicle's first mission.

    Args:
        ground: The site.
        setup: Heights, with pads at the vehicles' positions.
        plan: First plan to fly.
        day: The day plan that it is a part of.
        own: Each vehicle's own action on a lost link.
        parameters: Parameters that each vehicle answered.
    """
    dialects = {table.name: missions.dialect_for(table.autopilot) for table in ground.site.vehicle}
    performances = {
        name: missions.apply_tunings(
            dialects[name].performance, dialects[name].tunings, missions.add_first_names(dialects[name], known)
        )
        for name, known in parameters.items()
    }
    task = plan.build_task()
    pads = {} if day is None else day_plans.find_day_pads(day, ground, setup)
    context = site_model.build_context(ground, day_plans.add_day_pads(setup, pads), task, own, performances)
    first = context.setup
    if day is not None:
        context = replace(context, day=day_plans.build_day_rules(day, pads))
        first = replace(first, landings=day_plans.find_first_landings(day, pads))
    routes = plan.network_routes
    paths = site_model.build_paths(first, routes, context.vehicles)
    return context, {
        name: build_onboard_mission(context, name, 0, paths[name], routes[name]) if name in paths else None
        for name in context.vehicles
    }


def _build_pads(rows: Mapping[str, AskedVehicle], names: tuple[str, ...]) -> list[missions.Pad] | None:
    pads = []
    for name in names:
        row = rows.get(name)
        if row is None or row.pad is None:
            return None  # older directory: pads as in the site
        pads.append(missions.Pad(name, row.pad.east_m, row.pad.north_m, row.pad.alt_m))
    return pads
