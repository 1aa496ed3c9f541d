"""A small line to fly, and what the executor makes of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, TypeVar

from executor.core.context import Context
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import OnboardMission
from executor.core.state.vehicle_state import VehicleState, build_onboard_mission
from executor.site import site_model
from executor.site.site_file import Site, check_site
from executor.site.site_model import SiteModel
from missions import Network, build_flight_path
from tests.missions.builders import line_east

State = TypeVar("State", VehicleState, FleetState)
Routes = Mapping[str, tuple[int, ...]]

THREE: Routes = {"uav1": (0, 2), "uav2": (4, 6), "uav3": (8, 10)}
"""Two segments of 100 m each, all flown eastward, on a line of six."""


def site_of(names: tuple[str, ...], autopilot: str = "ardupilot", /, **tables: Mapping[str, object]) -> Site:
    """Return a site for a fleet on made-up ports."""
    vehicles = [
        {"name": name, "connection": f"udpin://127.0.0.1:{14550 + number}", "sysid": number, "autopilot": autopilot}
        for number, name in enumerate(names, start=1)
    ]
    # In these flights nobody is at the pads, unless a test says so.
    flight = {"fly_again": "auto", **tables.pop("flight", {})}
    return check_site({"network": {"file": "line"}, "vehicle": vehicles, "flight": flight, **tables}, "test")


def ground_for(site: Site, network: Network) -> SiteModel:
    """Return what is known before any vehicle answers."""
    return site_model.build_site_model(site, network)


@dataclass(frozen=True, slots=True)
class Fleet:
    """A flight that is ready to begin."""

    context: Context
    boards: dict[str, OnboardMission | None]


def fleet_of(
    routes: Routes = THREE, *, pylons: int = 7, autopilot: str = "ardupilot", **tables: Mapping[str, object]
) -> Fleet:
    """Return a fleet over a line due east of the depot, pylons every 100 m; an empty route stays on the ground."""
    ground = ground_for(site_of(tuple(routes), autopilot, **tables), line_east(pylons))
    setup, task = ground.setup, site_model.build_first_task(ground)
    context = site_model.build_context(ground, setup, task)
    boards = {
        name: build_onboard_mission(context, name, 0, build_flight_path(setup, name, visits), visits)
        if visits
        else None
        for name, visits in routes.items()
    }
    return Fleet(context, boards)


def vehicle(fleet: Fleet, name: str = "uav1", /, **changes: object) -> VehicleState:
    """Return one vehicle with its mission on board."""
    return with_facts(VehicleState(name), **({"board": fleet.boards[name]} | changes))


def with_facts(state: State, **facts: object) -> State:
    """Return a state in which some things are so, whichever part of it they belong to."""
    part_of = {fact: part for part, held in parts_of(state).items() for fact in held}
    told: dict[str, dict[str, Any]] = {}
    for name, value in facts.items():
        told.setdefault(part_of.get(name, ""), {})[name] = value
    parts = {part: replace(getattr(state, part), **held) for part, held in told.items() if part}
    return replace(state, **told.get("", {}), **parts)


def flat(state: object) -> dict[str, object]:
    """Return all that a dataclass holds by its name, for a state that of its parts instead of them."""
    parts = parts_of(state)
    held: dict[str, object] = {}
    for one in fields(state):  # type: ignore[arg-type]
        held |= parts.get(one.name, {one.name: getattr(state, one.name)})
    return held


def parts_of(state: object) -> dict[str, dict[str, object]]:
    """Return the parts of a state by their names, and what each holds."""
    if not isinstance(state, VehicleState | FleetState):
        return {}
    parts = {one.name: getattr(state, one.name) for one in fields(state) if is_dataclass(one.default_factory)}
    return {part: {one.name: getattr(held, one.name) for one in fields(held)} for part, held in parts.items()}
