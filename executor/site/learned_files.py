"""Read and write packs.json and learned.json: what earlier flights revealed about packs and vehicles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from executor.adapters.run_directory import Document, Hundredths, Number, Thousandths, Whole
from executor.core import vehicle_learning
from executor.core.battery.kalman import Prior
from executor.core.battery.pack_condition import PackFlightRecord, PackHistory, build_pack_history
from executor.core.context import Context
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import FaultKind
from executor.core.vehicle_learning import BOUNDS, FACTOR_BOUNDS, KnownVehicle, PaceEstimate
from executor.site.site_file import Site
from missions import Performance
from missions.validation import Figure

FORMAT: Literal["faultline-packs/1"] = "faultline-packs/1"
UNIX_USEC = 10**15
"""Earliest clock of a log that gives a date."""
FourDigits = AfterValidator(partial(round, ndigits=4))


class PackEntry(Document):
    """One flight of one pack; None where the log lacks a value."""

    log: str
    """Name of the log file."""
    vehicle: str
    pack: Annotated[Whole, Field(ge=1)]
    """Number of the vehicle's pack in this log, from 1."""
    label: str | None = None
    """Label of the pack: the vehicle's `pack` in the site file of the replay."""
    began_usec: Whole
    """Time on the log's clock."""
    minutes: Hundredths
    cells: Annotated[Whole, Field(ge=1)]
    rest_cell_v: Thousandths | None
    """Resting cell voltage before the flight."""
    end_cell_v: Thousandths
    """Resting cell voltage at the end, estimated."""
    began_pct: Number
    ended_pct: Number
    """Battery level at the end, as reported."""
    sag_cell_v: Thousandths | None = None
    ohm: Annotated[Number, FourDigits] | None = None
    ohm_sd: Annotated[Number, FourDigits] | None = None
    counted_ah: Thousandths | None = None
    set_ah: Thousandths | None = None
    """Capacity set in its autopilot."""
    least_ah: Hundredths | None = None
    most_ah: Hundredths | None = None
    """Upper bound of the capacity by voltage, given the uncertainty of chemistry and curves."""


class PacksDocument(Document):
    """Known flights of packs."""

    expected = "the packs' states learned from flights"
    format: Literal["faultline-packs/1"]
    flights: tuple[PackEntry, ...]


@dataclass(frozen=True, slots=True)
class SitePacks:
    """History of a site's packs."""

    fitted: Mapping[str, PackHistory] = field(default_factory=dict)
    """Packs that vehicles start with, by vehicle name."""
    labelled: Mapping[str, PackHistory] = field(default_factory=dict)
    """Packs with a known flight, and those that vehicles start with, by label."""


def load_site_packs(site: Site, base: Path) -> SitePacks:
    """Return the history of the packs that vehicles fly with.

    Raises:
        LogError: the file that `energy.packs` names cannot be used.
    """
    if site.energy.packs is None:
        return SitePacks()
    flights = PacksDocument.read(base / site.energy.packs).flights
    begins = {one.name: one.pack for one in site.vehicle if one.pack is not None}
    labels = {one.label for one in flights if one.label} | set(begins.values())
    known = {label: _build_history(label, flights) for label in sorted(labels)}
    return SitePacks({name: known[label] for name, label in begins.items()}, known)


def _build_history(label: str, flights: tuple[PackEntry, ...]) -> PackHistory:
    # Logs without a date come first: their age is unknown.
    mine = sorted(
        (one for one in flights if one.label == label),
        key=lambda one: one.began_usec if one.began_usec >= UNIX_USEC else 0,
    )
    return build_pack_history(label, [PackFlightRecord(one.most_ah, one.ohm, one.set_ah) for one in mine])


USEC = 1e6


def build_flown_packs(state: FleetState, log: str, began_unix_s: float) -> PacksDocument:
    """Return the pack entries of a flight's sorties, for packs that the crew named or changed.

    Args:
        state: State at the end of the flight.
        log: Name of its run directory.
        began_unix_s: Seconds since 1970 at which its clock was 0.
    """
    entries = []
    for name, vehicle in state.vehicles.items():
        numbers: dict[tuple[str, int], int] = {}
        for at, one in enumerate(vehicle.turn.sorties):
            if one.ended_s is None or one.cells is None or one.end_v is None:
                continue
            if one.began_pct is None or one.ended_pct is None:
                continue
            # A pack without a label counts as a new one for each sortie, as nothing identifies it.
            number = numbers.setdefault((one.pack, 0 if one.pack else at), len(numbers) + 1)
            entries.append(
                PackEntry.build_from(
                    one,
                    log=log,
                    vehicle=name,
                    pack=number,
                    label=one.pack or None,
                    began_usec=round((began_unix_s + one.began_s) * USEC),
                    minutes=(one.ended_s - one.began_s) / 60.0,
                    rest_cell_v=None if one.rest_v is None else one.rest_v / one.cells,
                    end_cell_v=one.end_v / one.cells,
                )
            )
    return PacksDocument(format=FORMAT, flights=tuple(entries))


Ratio = Annotated[Figure, Field(ge=BOUNDS[0], le=BOUNDS[1]), FourDigits]
Power = Annotated[Figure, Field(ge=FACTOR_BOUNDS[0], le=FACTOR_BOUNDS[1]), FourDigits]
Deviation = Annotated[Figure, Field(gt=0, le=1), FourDigits]
Count = Annotated[Whole, Field(ge=0)]


class PacePart(Document):
    """Factor on the times of legs: 1 matches the model, more is slower."""

    mean: Ratio
    sd: Deviation
    legs: Count
    """Number of legs it was learned from."""


class ConsumptionPart(Document):
    """Consumption of a vehicle relative to the energy model."""

    mean: Power
    sd: Deviation
    minutes: Annotated[Figure, Field(ge=0), AfterValidator(partial(round, ndigits=1))]
    """Flight minutes it was learned from."""


class LearnedVehicle(Document):
    """Learned figures of one vehicle."""

    name: str
    autopilot: str
    drone: str
    """Energy model that the consumption is relative to."""
    inspect: PacePart
    """Pace on inspections."""
    transit: PacePart
    """Pace on transits and RTL."""
    consumption: ConsumptionPart
    performance: Performance | None = None
    """Performance by its own parameters, which the factors are relative to."""


class LearnedDocument(Document):
    """Learned figures of all vehicles."""

    expected = "the data learned about a flight's vehicles"
    format: Literal["faultline-learned/1"]
    date: Annotated[str, Field(pattern=r"^\d{4}-\d{2}-\d{2}$")]
    """Date of the flight's end."""
    vehicles: tuple[LearnedVehicle, ...]

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        names = [vehicle.name for vehicle in self.vehicles]
        for index, name in enumerate(names):
            if name in names[:index]:
                raise ValueError(f"vehicles[{index}].name: expected one of its own, got {name}, which another has")
        return self

    @property
    def known_by_name(self) -> dict[str, KnownVehicle]:
        """Learned figures by vehicle name."""
        return {one.name: _parse_known(one) for one in self.vehicles}


def build_learned_document(known: Mapping[str, KnownVehicle], date: str) -> LearnedDocument:
    """Return the content of learned.json."""
    rows = [
        LearnedVehicle.build_from(
            one,
            name=name,
            consumption=ConsumptionPart.build_from(one.consumption, mean=one.consumption.factor, minutes=one.minutes),
        )
        for name, one in known.items()
    ]
    return LearnedDocument(format="faultline-learned/1", date=date, vehicles=tuple(rows))


def learn_from_flight(
    context: Context, state: FleetState, before: Mapping[str, KnownVehicle], date: str
) -> LearnedDocument:
    """Return a fleet's learned figures after a flight.

    Args:
        context: Context of the flight.
        state: State at its end.
        before: Learned figures at its start, by vehicle name.
        date: Date of its end.
    """
    known = {}
    for name, setup in context.vehicles.items():
        vehicle = state.vehicles[name]
        learned = vehicle.assignment.learned
        if learned is None and name not in before:
            continue
        fault = vehicle.fault
        known[name] = before[name] if learned is None else vehicle_learning.update_known_vehicle(
            learned, before.get(name), setup.prior, autopilot=setup.dialect.name, drone=context.drone.name,
            performance=context.pricing.models[name].performance,
            drained=fault is not None and fault.kind is FaultKind.BATTERY,
        )  # fmt: skip
    return build_learned_document(known, date)


def describe_learned(vehicle: LearnedVehicle) -> str:
    """Return a vehicle's learned figures in one line."""

    def of(part: PacePart | ConsumptionPart) -> str:
        return f"{100 * part.mean:.0f} ± {100 * part.sd:.0f} %"

    return (
        f"{vehicle.name}: inspections take {of(vehicle.inspect)} of the model's time, transits {of(vehicle.transit)}, "
        f"consumption {of(vehicle.consumption)}, from {vehicle.inspect.legs + vehicle.transit.legs} legs"
    )


def _parse_known(row: LearnedVehicle) -> KnownVehicle:
    return KnownVehicle(
        PaceEstimate(row.inspect.mean, row.inspect.sd**2, row.inspect.legs),
        PaceEstimate(row.transit.mean, row.transit.sd**2, row.transit.legs),
        Prior(row.consumption.mean, row.consumption.sd),
        row.consumption.minutes,
        row.autopilot,
        row.drone,
        row.performance,
    )
