"""Whether the packs are what the plan, and their own counters, take them for: before anything moves."""

from __future__ import annotations

from executor.core.battery import pack, resting
from executor.core.battery.pack import Pack
from executor.core.battery.resting import NO_FACTS, PackFacts
from executor.core.check_codes import CheckCode
from executor.core.context import Context
from executor.core.preflight.checks import Check, Facts, Severity

LIKE = 1.1
"""Capacities that differ by less are one: what stands on a pack, and what somebody typed."""


def pack_checks(context: Context, facts: Facts) -> list[Check]:
    """Hold the capacity that it counts by against the plan's, and its voltage at rest against its percentage."""
    said = NO_FACTS
    for name in resting.PARAMETERS:
        if name in facts.parameters:
            said = resting.with_parameter(said, name, facts.parameters[name])
    setup = context.vehicles[facts.name]
    known = said.under(setup.pack)
    return [*_capacity(context, facts.name, said), *_voltage(facts, known, reads_volts=_reads_volts(context, facts))]


def _capacity(context: Context, name: str, said: PackFacts) -> list[Check]:
    planned_ah, counted_ah = context.drone.capacity_ah, said.capacity_ah
    if counted_ah is None or planned_ah / LIKE <= counted_ah <= planned_ah * LIKE:
        return []
    text = (
        f"it counts by a pack of {counted_ah:g} Ah, the plan by {planned_ah:g} Ah ([energy] capacity_ah): its "
        f"percentage will fall {planned_ah / counted_ah:.1f} times as fast as planned"
    )
    return [Check(Severity.WARNING, name, text, CheckCode.PACK)]


def _reads_volts(context: Context, facts: Facts) -> bool:
    """Return whether its percentage is read off the voltage: PX4's, where it is not told a capacity."""
    dialect = context.vehicles[facts.name].dialect
    return dialect.rounds_twice and facts.parameters.get("BAT1_CAPACITY", -1.0) <= 0.0


def _voltage(facts: Facts, known: PackFacts, *, reads_volts: bool) -> list[Check]:
    if facts.voltage_v is None:
        text = "no voltage is reported: nobody can say whether its pack holds what it reports"
        return [Check(Severity.OK, facts.name, text, CheckCode.PACK)]
    cells = facts.cells or known.cells or resting.least_cells(facts.voltage_v)
    rests = pack.with_voltage(Pack(known), facts.voltage_v, None, facts.remaining_pct, 0.0, idle=True)
    found = pack.standing(rests, cells, known.chemistry, facts.remaining_pct, 0.0)
    if found is None:
        return []
    count = f"{cells} cells" if facts.cells or known.cells else f"at least {cells} cells, as nobody says how many"
    text = f"its pack {found.words} ({count})"
    if reads_volts:
        return [Check(Severity.OK, facts.name, f"{text}, read off that voltage", CheckCode.PACK)]
    severity = Severity.WARNING if found.doubtful else Severity.OK
    return [Check(severity, facts.name, text, CheckCode.PACK)]
