"""Whether the packs are what the plan, and their own counters, take them for: before anything moves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from executor.core.battery import pack_condition, voltage
from executor.core.battery.pack_condition import RECENT, PackCondition, PackState
from executor.core.battery.voltage import NO_FACTS, PackFacts
from executor.core.context import Context, VehicleSetup
from executor.core.formatting import format_count
from executor.core.interface.codes import CheckCode
from executor.core.preflight.vehicle_checks import Check, Severity, VehicleFacts

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
    for name in voltage.PARAMETERS:
        if name in parameters:
            said = voltage.apply_pack_parameter(said, name, parameters[name])
    return said


def assess_pack_at_rest(setup: VehicleSetup, heard: PackReading) -> PackAtRest | None:
    """Return how a vehicle's pack stands at rest; None where no voltage is reported."""
    if heard.voltage_v is None:
        return None
    known = pack_facts_from_parameters(heard.parameters).override_with(setup.pack)
    cells = heard.cells or known.cells or voltage.least_cell_count(heard.voltage_v)
    at_rest = pack_condition.apply_pack_voltage(
        PackState(known), heard.voltage_v, None, heard.remaining_pct, 0.0, idle=True
    )
    found = pack_condition.assess_pack(at_rest, cells, known, heard.remaining_pct, 0.0)
    if found is None:
        return None
    counted = heard.cells or known.cells
    count = f"{cells} cells" if counted else f"at least {cells} cells, cell count not reported"
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
    text = f"its pack {known.label}{describe_pack_history(setup, planned_ah)}"
    return [Check(Severity.WARNING if worn else Severity.OK, setup.name, text, CheckCode.PACK)]


def describe_pack_history(setup: VehicleSetup, planned_ah: float) -> str:
    """Return what earlier flights said of a pack, to be put behind its name; empty where it has no label."""
    known = setup.history
    if known is None:
        return ""
    if known.capacity_ah is None and known.ohm is None:
        silent = f"{format_count(known.flights, 'flight')} did not say"
        what = silent if known.flights else "no flight of it is known"
        return f": {what}; the plan reckons with {planned_ah:g} Ah"
    parts = []
    if known.capacity_ah is not None:
        share_pct = 100.0 * known.capacity_ah[0] / planned_ah
        parts.append(f"{known.capacity_ah[0]:.1f} Ah, {share_pct:.0f} % of the plan's {planned_ah:g} Ah")
    if known.ohm is not None:
        parts.append(f"{1000.0 * known.ohm[0]:.0f} mOhm")
    text = f" has {' and '.join(parts)}, by {format_count(min(known.flights, RECENT), 'flight')}"
    worn = known.share_of(planned_ah) < 1.0
    if worn:
        text += f": budget {setup.budget_pct:.0f} %"
    if setup.empty_pct > 0:
        text += f"{', ' if worn else ': '}empty at {setup.empty_pct:.0f} % of what it counts"
    return text


def _check_capacity(context: Context, name: str, said: PackFacts) -> list[Check]:
    planned_ah, counted_ah = context.drone.capacity_ah, said.capacity_ah
    if counted_ah is None or planned_ah / LIKE <= counted_ah <= planned_ah * LIKE:
        return []
    text = (
        f"it counts by a pack of {counted_ah:g} Ah, the plan by {planned_ah:g} Ah ([energy] capacity_ah): its "
        f"percentage will fall {planned_ah / counted_ah:.1f} times as fast as planned"
    )
    return [Check(Severity.WARNING, name, text, CheckCode.PACK)]


def _check_voltage(facts: VehicleFacts, found: PackAtRest | None) -> list[Check]:
    if facts.voltage_v is None:
        text = "no voltage is reported: the reported charge cannot be verified"
        return [Check(Severity.OK, facts.name, text, CheckCode.PACK)]
    if found is None:
        return []
    text = f"its pack {found.standing.words} ({found.count})"
    if found.reads_volts:
        return [Check(Severity.OK, facts.name, f"{text}, read off that voltage", CheckCode.PACK)]
    severity = Severity.WARNING if found.doubtful else Severity.OK
    return [Check(severity, facts.name, text, CheckCode.PACK)]
