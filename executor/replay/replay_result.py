"""Results of replaying a recorded flight, as plain data for the table, the pictures and the pages.

A vehicle's packs (sag, resistance and capacity) are kept in packs.json, one entry per flight; further logs add to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from executor.core.battery import voltage
from executor.core.battery.pack_condition import RestReading
from executor.core.battery.voltage import Chemistry, PackFacts
from executor.core.interface.messages import Actor
from executor.core.interface.recorded_log import SkippedRecords
from executor.core.state.vehicle_state import FaultKind, VehicleState
from executor.site.learned_files import FORMAT, PackEntry, PacksDocument

TRACE_S = 3.0
MOST_SAMPLES = 4000
LEAST_USED_PCT = 15.0
"""Least consumption by voltage for estimating a capacity: 10 mV of a cell are a percent."""
ANOTHER_PCT = 20.0
"""Least rise of the percentage at the next take-off for another pack, or a charged one."""


@dataclass(frozen=True, slots=True)
class ReplaySample:
    """A vehicle's values at one moment, for pictures."""

    at_s: float
    remaining_pct: float | None
    estimate_pct: float | None
    sd_pct: float | None
    landing_pct: float | None
    """Target percentage at landing."""
    voltage_v: float | None
    link_age_s: float
    heartbeat_age_s: float
    item: int | None
    height_m: float | None


@dataclass(slots=True)
class SampleTrace:
    """Samples of one vehicle; if there are too many, every second one is dropped, so that memory stays constant."""

    samples: list[ReplaySample] = field(default_factory=list)
    every_s: float = TRACE_S

    def add(self, at_s: float, take: Callable[[], ReplaySample]) -> None:
        """Take a sample, unless the last one is recent."""
        if self.samples and at_s - self.samples[-1].at_s < self.every_s:
            return
        self.samples.append(take())
        if len(self.samples) > MOST_SAMPLES:
            self.samples = self.samples[::2]
            self.every_s *= 2


@dataclass(frozen=True, slots=True)
class Declaration:
    """A declared fault, in the log's own time."""

    kind: FaultKind
    reason: str
    t_usec: int
    evidence: str


@dataclass(frozen=True, slots=True)
class ImpairedPeriod:
    """A period with an impairment, in the log's own time."""

    kind: FaultKind
    reason: str
    from_usec: int
    to_usec: int
    evidence: str


@dataclass(frozen=True, slots=True)
class ModeTransition:
    """A mode change of an armed vehicle, in the log's own time."""

    t_usec: int
    mode: str
    by: Actor
    why: str
    """Evidence in the log for the cause; empty if none."""


@dataclass(frozen=True, slots=True)
class VehicleReplay:
    """Results for one vehicle of a log."""

    sysid: int
    name: str
    autopilot: str
    declarations: tuple[Declaration, ...]
    degraded: tuple[ImpairedPeriod, ...]
    flown_s: float
    """Seconds armed."""
    samples: tuple[ReplaySample, ...]
    modes: tuple[ModeTransition, ...] = ()
    packs: tuple[PackEntry, ...] = ()
    """Each flight's data about its pack."""


@dataclass(frozen=True, slots=True)
class LogReplay:
    """Results for one log."""

    path: Path
    vehicles: tuple[VehicleReplay, ...]
    skipped: SkippedRecords
    began_usec: int
    lasted_s: float
    notes: tuple[str, ...] = ()


@dataclass(slots=True)
class PackBook:
    """One vehicle's packs in one log."""

    flights: list[PackEntry] = field(default_factory=list)
    _number: int = 0
    _rest: RestReading | None = None
    _began_s: float | None = None
    _counted: tuple[float | None, float] = (None, 0.0)
    """Counter and percentage at take-off."""
    _latest: PackEntry | None = None

    def update(self, vehicle: VehicleState, facts: PackFacts, at_s: float) -> None:
        """Update with a vehicle's state: a flight begins at take-off, and ends at disarming."""
        flies = vehicle.armed and vehicle.sortie.took_off
        if flies and self._began_s is None:
            self._begin_flight(vehicle, at_s)
        elif flies:
            flight = self._build_flight(vehicle, facts, at_s)
            if flight is not None:
                self._latest = flight
        elif self._began_s is not None:
            self.close_flights()

    def close_flights(self) -> tuple[PackEntry, ...]:
        """End the current flight, if any, and return all flights."""
        if self._latest is not None:
            self.flights.append(self._latest)
        self._began_s = self._latest = None
        return tuple(self.flights)

    def _begin_flight(self, vehicle: VehicleState, at_s: float) -> None:
        pct = vehicle.power.battery.remaining_pct
        if pct is None:
            return
        if not self.flights or pct > self.flights[-1].ended_pct + ANOTHER_PCT:
            self._number += 1
        self._began_s, self._rest = at_s, vehicle.power.pack.rest
        self._counted = (vehicle.power.battery.charge.consumed_ah, pct)

    def _build_flight(self, vehicle: VehicleState, facts: PackFacts, at_s: float) -> PackEntry | None:
        power, pct = vehicle.power, vehicle.power.battery.remaining_pct
        if pct is None or power.volts.voltage_v is None or self._began_s is None:
            return None
        cells, sag = power.volts.cells, power.pack.sag
        cell_v = power.volts.voltage_v / cells if sag is None else sag.recovered_v / cells
        known_v = 0.0 if self._latest is None else self._latest.sag_cell_v or 0.0
        flight = PackEntry.model_construct(
            log="",
            vehicle="",
            pack=self._number,
            began_usec=round(self._began_s * 1e6),
            minutes=(at_s - self._began_s) / 60.0,
            cells=cells,
            rest_cell_v=None if self._rest is None else self._rest.voltage_v / cells,
            end_cell_v=cell_v,
            began_pct=self._counted[1] if self._rest is None else self._rest.claimed_pct,
            ended_pct=pct,
            sag_cell_v=None if sag is None else max(0.0, sag.ohm * sag.current_a / cells, known_v),
            ohm=None if sag is None else max(0.0, sag.ohm),
            ohm_sd=None if sag is None else sag.ohm_sd,
            counted_ah=self._draw_ah(vehicle, facts, pct),
            set_ah=facts.capacity_ah,
        )
        least_ah, most_ah = (None if sag is None else self._capacity_ah(flight, facts.chemistry)) or (None, None)
        return flight.model_copy(update={"least_ah": least_ah, "most_ah": most_ah})

    def _capacity_ah(self, flight: PackEntry, chemistry: Chemistry | None) -> tuple[float, float] | None:
        mine = [one for one in self.flights if one.pack == flight.pack]
        if not mine or flight.counted_ah is None or any(one.counted_ah is None for one in mine):
            return capacity_ah(flight, chemistry)
        counted_ah = flight.counted_ah + sum(one.counted_ah or 0.0 for one in mine)
        whole = flight.model_copy(update={"rest_cell_v": mine[0].rest_cell_v, "counted_ah": counted_ah})
        return capacity_ah(whole, chemistry)

    def _draw_ah(self, vehicle: VehicleState, facts: PackFacts, pct: float) -> float | None:
        counter, began_pct = vehicle.power.battery.charge.consumed_ah, self._counted[1]
        if counter is not None and self._counted[0] is None:
            self._counted = (vehicle.power.battery.charge.began_ah, began_pct)
        if counter is not None and self._counted[0] is not None and counter > self._counted[0]:
            return counter - self._counted[0]
        return None if facts.capacity_ah is None else max(0.0, began_pct - pct) / 100.0 * facts.capacity_ah


def capacity_ah(flight: PackEntry, chemistry: Chemistry | None) -> tuple[float, float] | None:
    """Return a flight's estimate of its pack's capacity; None if too little was used, or no charge was counted."""
    if flight.rest_cell_v is None or not flight.counted_ah:
        return None
    found = []
    for one in (chemistry,) if chemistry is not None else Chemistry:
        used_pct = voltage.rest_charge_pct(flight.rest_cell_v, one) - voltage.rest_charge_pct(flight.end_cell_v, one)
        if used_pct < LEAST_USED_PCT:
            return None
        found.append(100.0 * flight.counted_ah / used_pct)
    return min(found), max(found)


def merge_packs(
    replays: Iterable[LogReplay], before: PacksDocument | None = None, labels: Mapping[int, str] = MappingProxyType({})
) -> PacksDocument:
    """Merge further logs into the known packs; a known flight is replaced.

    Args:
        replays: The logs.
        before: The packs known before.
        labels: Label of each system's pack; ignored for a log in which the system changes its pack.
    """
    known = {} if before is None else {_key_of(one): one for one in before.flights}
    for replayed in replays:
        for vehicle in replayed.vehicles:
            label = labels.get(vehicle.sysid) if all(flight.pack == 1 for flight in vehicle.packs) else None
            for flight in vehicle.packs:
                began_usec = replayed.began_usec + flight.began_usec
                entry = PackEntry.build_from(
                    flight, log=replayed.path.name, vehicle=vehicle.name, began_usec=began_usec
                )
                was = known.get(_key_of(entry))
                told = label if label is not None or was is None else was.label
                known[_key_of(entry)] = entry.model_copy(update={"label": told})
    return PacksDocument(format=FORMAT, flights=tuple(known[key] for key in sorted(known)))


def _key_of(entry: PackEntry) -> tuple[str, str, int]:
    return entry.vehicle, entry.log, entry.began_usec


def format_pack_lines(document: PacksDocument) -> Iterable[str]:
    """Yield a table of flights by vehicle and pack, for people."""
    yield (
        f"{'vehicle':<10} {'pack':>6} {'log':<28} {'min':>5} {'cells':>5} {'rest V':>6} {'end V':>6} "
        f"{'reported %':>11} "
        f"{'sag V':>6} {'mOhm':>11} {'used Ah':>7} {'set Ah':>6} {'by voltage Ah':>13}"
    )
    for one in document.flights:
        reported = f"{one.began_pct:.0f} to {one.ended_pct:.0f}"
        ohm = "-" if one.ohm is None else f"{1000 * one.ohm:.0f} +- {1000 * (one.ohm_sd or 0.0):.0f}"
        capacity = "-" if one.least_ah is None else f"{one.least_ah:.1f} to {one.most_ah:.1f}"
        yield (
            f"{one.vehicle:<10} {one.label or one.pack:>6} {one.log[-28:]:<28} {one.minutes:>5.1f} {one.cells:>5} "
            f"{_format_figure(one.rest_cell_v, 2):>6} {one.end_cell_v:>6.2f} {reported:>11} "
            f"{_format_figure(one.sag_cell_v, 2):>6} {ohm:>11} {_format_figure(one.counted_ah, 2):>7} "
            f"{_format_figure(one.set_ah, 1):>6} "
            f"{capacity:>13}"
        )


def _format_figure(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
