"""What flights say of a vehicle's packs: sag, resistance and capacity, flight by flight, as they are replayed."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from executor.core.battery import voltage
from executor.core.battery.pack_condition import RestReading
from executor.core.battery.voltage import Chemistry, PackFacts
from executor.core.state.vehicle_state import VehicleState

LEAST_USED_PCT = 15.0
"""By its voltage so much must be used before a capacity is worth a figure: 10 mV of a cell are a percent."""
ANOTHER_PCT = 20.0
"""A percentage that is so much higher at the next take-off is that of another pack, or of a charged one."""


@dataclass(frozen=True, slots=True)
class PackFlight:
    """One flight of a pack."""

    began_s: float
    ended_s: float
    number: int
    """Which of the packs in this log it is, from 1."""
    cells: int
    began_cell_v: float | None
    """A cell at rest before the flight."""
    ended_cell_v: float
    """A cell at its end as it would rest."""
    began_pct: float
    ended_pct: float
    """What was reported at rest before, and at the end."""
    sag_cell_v: float | None
    """The most that a cell lost under the load."""
    ohm: float | None
    ohm_sd: float | None
    """Of the whole pack; None where no current was reported."""
    counted_ah: float | None
    """What its counter says was used."""
    set_ah: float | None
    """The capacity that its autopilot counts by."""
    capacity_ah: tuple[float, float] | None
    """What its voltage says of its capacity since it was put in: the least and the most, by the chemistries that it may
    have."""


@dataclass(slots=True)
class PackBook:
    """One vehicle's packs in one log."""

    flights: list[PackFlight] = field(default_factory=list)
    _number: int = 0
    _rest: RestReading | None = None
    _began_s: float | None = None
    _counted: tuple[float | None, float] = (None, 0.0)
    """The counter and the percentage at the take-off."""
    _latest: PackFlight | None = None

    def update(self, vehicle: VehicleState, facts: PackFacts, at_s: float) -> None:
        """Look at a vehicle: a flight begins when it has taken off, and ends when it disarms."""
        flies = vehicle.armed and vehicle.sortie.took_off
        if flies and self._began_s is None:
            self._begin_flight(vehicle, at_s)
        elif flies:
            flight = self._build_flight(vehicle, facts, at_s)
            if flight is not None:
                self._latest = flight
        elif self._began_s is not None:
            self.close_flights()

    def close_flights(self) -> tuple[PackFlight, ...]:
        """End the flight under way, if there is one, and return all of them."""
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

    def _build_flight(self, vehicle: VehicleState, facts: PackFacts, at_s: float) -> PackFlight | None:
        power, pct = vehicle.power, vehicle.power.battery.remaining_pct
        if pct is None or power.volts.voltage_v is None or self._began_s is None:
            return None
        cells, sag = power.volts.cells, power.pack.sag
        cell_v = power.volts.voltage_v / cells if sag is None else sag.recovered_v / cells
        flight = PackFlight(
            began_s=self._began_s,
            ended_s=at_s,
            number=self._number,
            cells=cells,
            began_cell_v=None if self._rest is None else self._rest.voltage_v / cells,
            ended_cell_v=cell_v,
            began_pct=self._counted[1] if self._rest is None else self._rest.claimed_pct,
            ended_pct=pct,
            sag_cell_v=None if sag is None else self._highest_sag_v(sag.ohm * sag.current_a / cells),
            ohm=None if sag is None else max(0.0, sag.ohm),
            ohm_sd=None if sag is None else sag.ohm_sd,
            counted_ah=self._draw_ah(vehicle, facts, pct),
            set_ah=facts.capacity_ah,
            capacity_ah=None,
        )
        return flight if sag is None else replace(flight, capacity_ah=self._capacity_ah(flight, facts.chemistry))

    def _highest_sag_v(self, now_v: float) -> float:
        return max(0.0, now_v, 0.0 if self._latest is None else self._latest.sag_cell_v or 0.0)

    def _capacity_ah(self, flight: PackFlight, chemistry: Chemistry | None) -> tuple[float, float] | None:
        """Return what the flights of this pack so far say of its capacity."""
        mine = [one for one in self.flights if one.number == flight.number]
        if not mine or flight.counted_ah is None or any(one.counted_ah is None for one in mine):
            return capacity_ah(flight, chemistry)
        counted_ah = flight.counted_ah + sum(one.counted_ah or 0.0 for one in mine)
        whole = replace(flight, began_cell_v=mine[0].began_cell_v, counted_ah=counted_ah)
        return capacity_ah(whole, chemistry)

    def _draw_ah(self, vehicle: VehicleState, facts: PackFacts, pct: float) -> float | None:
        counter, began_pct = vehicle.power.battery.charge.consumed_ah, self._counted[1]
        if counter is not None and self._counted[0] is None:
            self._counted = (vehicle.power.battery.charge.began_ah, began_pct)
        if counter is not None and self._counted[0] is not None and counter > self._counted[0]:
            return counter - self._counted[0]
        return None if facts.capacity_ah is None else max(0.0, began_pct - pct) / 100.0 * facts.capacity_ah


def capacity_ah(flight: PackFlight, chemistry: Chemistry | None) -> tuple[float, float] | None:
    """Return what a flight says of its pack's capacity; None where too little was used, or nobody counted."""
    if flight.began_cell_v is None or not flight.counted_ah:
        return None
    found = []
    for one in (chemistry,) if chemistry is not None else Chemistry:
        used_pct = voltage.rest_charge_pct(flight.began_cell_v, one) - voltage.rest_charge_pct(flight.ended_cell_v, one)
        if used_pct < LEAST_USED_PCT:
            return None
        found.append(100.0 * flight.counted_ah / used_pct)
    return min(found), max(found)
