"""Whether the packs are what the plan, and their own counters, take them for: before anything moves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from executor.core.battery import pack_condition, resting_voltage
from executor.core.battery.pack_condition import PackCondition, PackState
from executor.core.battery.pack_history import RECENT
from executor.core.battery.resting_voltage import NO_FACTS, PackFacts
from executor.core.context import Context, VehicleSetup
from executor.core.formatting import format_count
from executor.core.interface.check_codes import Check, CheckCode, Severity
from executor.core.lines import checklist
from executor.core.preflight.vehicle_checks import VehicleFacts

LIKE = 1.1
"""Capacities that differ by less are one: what stands on a pack, and what somebody typed."""


@dataclass(frozen=True, slots=True)
class PackReading:
    """What a vehicle says of its pack at rest."""

    remaining_pct: float
    voltage_v: float | None
    cells: int | None
    """How many it tells apart."""
    parameters: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class PackAtRest:
    """How a pack stands at rest."""

    standing: PackCondition
    count: str
    """Of how many cells, in words."""
    reads_volts: bool
    """Whether its percentage is read off that voltage, and contradicts nothing."""

    @property
    def doubtful(self) -> bool:
        """Whether its percentage says more than its voltage allows."""
        return self.standing.doubtful and not self.reads_volts

    @property
    def held_pct(self) -> float:
        """What it holds: what its voltage says where that contradicts its percentage."""
        claimed_pct = self.standing.claimed_pct
        return min(claimed_pct, self.standing.held_pct) if self.doubtful else claimed_pct


def pack_facts_from_parameters(parameters: Mapping[str, float]) -> PackFacts:
    """Return what a vehicle's parameters say of its pack."""
    said = NO_FACTS
    for name in resting_voltage.PARAMETERS:
        if name in parameters:
            said = resting_voltage.apply_pack_parameter(said, name, parameters[name])
    return said


def assess_pack_at_rest(setup: VehicleSetup, heard: PackReading) -> PackAtRest | None:
    """Return how a vehicle's pack stands at rest; None where no voltage is reported."""
    if heard.voltage_v is None:
        return None
    known = pack_facts_from_parameters(heard.parameters).override_with(setup.pack)
    cells = heard.cells or known.cells or resting_voltage.least_cell_count(heard.voltage_v)
    at_rest = pack_condition.apply_pack_voltage(
        PackState(known), heard.voltage_v, None, heard.remaining_pct, 0.0, idle=True
    )
    found = pack_condition.assess_pack(at_rest, cells, known, heard.remaining_pct, 0.0)
    if found is None:
        return None
    count = (checklist.CELLS if heard.cells or known.cells else checklist.CELLS_AT_LEAST).format(cells=cells)
    reads_volts = setup.dialect.rounds_twice and heard.parameters.get("BAT1_CAPACITY", -1.0) <= 0.0
    return PackAtRest(found, count, reads_volts)


def check_pack(context: Context, facts: VehicleFacts) -> list[Check]:
    """Hold the capacity that it counts by against the plan's, and its voltage at rest against its percentage."""
    names = context.vehicles[facts.name].dialect.pack_parameters
    if unread := facts.check_parameters_read(names, "what its pack is taken for is", CheckCode.PACK):
        return unread
    said = pack_facts_from_parameters(facts.parameters)
    heard = PackReading(facts.remaining_pct, facts.voltage_v, facts.cells, facts.parameters)
    found = assess_pack_at_rest(context.vehicles[facts.name], heard)
    return [
        *_check_history(context, context.vehicles[facts.name]),
        *_check_capacity(context, facts.name, said),
        *_check_voltage(facts, found),
    ]


def _check_history(context: Context, setup: VehicleSetup) -> list[Check]:
    """Say what earlier flights said of its pack, and what is reckoned with for it."""
    known, planned_ah = setup.history, context.drone.capacity_ah
    if known is None:
        return []
    worn = known.share_of(planned_ah) < 1.0
    severity, history = Severity.WARNING if worn else None, describe_pack_history(setup, planned_ah)
    return [checklist.PACK_HISTORY.of(setup.name, severity, label=known.label, history=history)]


def describe_pack_history(setup: VehicleSetup, planned_ah: float) -> str:
    """Return what earlier flights said of a pack, to be put behind its name; empty where it has no label."""
    known = setup.history
    if known is None:
        return ""
    if known.capacity_ah is None and known.ohm is None:
        silent = checklist.FLIGHTS_SILENT if known.flights else checklist.NO_FLIGHTS
        return silent.format(flights=format_count(known.flights, "flight"), planned_ah=planned_ah)
    parts = []
    if known.capacity_ah is not None:
        has_ah = known.capacity_ah[0]
        share_pct = 100.0 * has_ah / planned_ah
        parts.append(checklist.HAS_CAPACITY.format(has_ah=has_ah, share_pct=share_pct, planned_ah=planned_ah))
    if known.ohm is not None:
        parts.append(checklist.HAS_RESISTANCE.format(mohm=1000.0 * known.ohm[0]))
    flights = format_count(min(known.flights, RECENT), "flight")
    text = checklist.HAS.format(what=" and ".join(parts), flights=flights)
    worn = known.share_of(planned_ah) < 1.0
    if worn:
        text += checklist.WORN_BUDGET.format(budget_pct=setup.budget_pct)
    if setup.empty_pct > 0:
        text += (", " if worn else ": ") + checklist.EMPTY_AT.format(empty_pct=setup.empty_pct)
    return text


def _check_capacity(context: Context, name: str, said: PackFacts) -> list[Check]:
    planned_ah, counted_ah = context.drone.capacity_ah, said.capacity_ah
    if counted_ah is None or planned_ah / LIKE <= counted_ah <= planned_ah * LIKE:
        return []
    factor = planned_ah / counted_ah
    return [checklist.PACK_CAPACITY.of(name, counted_ah=counted_ah, planned_ah=planned_ah, factor=factor)]


def _check_voltage(facts: VehicleFacts, found: PackAtRest | None) -> list[Check]:
    if facts.voltage_v is None:
        return [checklist.NO_VOLTAGE.of(facts.name)]
    if found is None:
        return []
    line = checklist.PACK_BY_VOLTS if found.reads_volts else checklist.PACK_AT_REST
    severity = Severity.WARNING if found.doubtful else None
    return [line.of(facts.name, severity, standing=found.standing.words, count=found.count)]
