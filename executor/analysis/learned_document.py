"""learned.json: what a flight taught about each of its vehicles, for the next plan of the same ones."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from executor.adapters.run_directory import Document, RunDirectory, Whole
from executor.core import vehicle_learning
from executor.core.battery.kalman import Prior
from executor.core.context import Context
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import FaultKind
from executor.core.vehicle_learning import BOUNDS, FACTOR_BOUNDS, KnownVehicle, PaceEstimate
from missions import Performance
from missions.validation import Figure

FourDigits = AfterValidator(partial(round, ndigits=4))
Ratio = Annotated[Figure, Field(ge=BOUNDS[0], le=BOUNDS[1]), FourDigits]
Power = Annotated[Figure, Field(ge=FACTOR_BOUNDS[0], le=FACTOR_BOUNDS[1]), FourDigits]
Deviation = Annotated[Figure, Field(gt=0, le=1), FourDigits]
Count = Annotated[Whole, Field(ge=0)]


class PacePart(Document):
    """A factor on the times of legs: 1 is as the model has it, more is slower."""

    mean: Ratio
    sd: Deviation
    legs: Count
    """It was learned from."""


class ConsumptionPart(Document):
    """What a vehicle uses relative to the energy model."""

    mean: Power
    sd: Deviation
    minutes: Annotated[Figure, Field(ge=0), AfterValidator(partial(round, ndigits=1))]
    """In the air that it was learned from."""


class LearnedVehicle(Document):
    """What is known of one vehicle."""

    name: str
    autopilot: str
    drone: str
    """Of the energy model that the consumption is relative to."""
    inspect: PacePart
    """On inspections."""
    transit: PacePart
    """On the way between segments, and home."""
    consumption: ConsumptionPart
    performance: Performance | None = None
    """How it moves by its own parameters, which the factors are relative to."""


class LearnedDocument(Document):
    """What flights taught about vehicles."""

    format: Literal["faultline-learned/1"]
    date: Annotated[str, Field(pattern=r"^\d{4}-\d{2}-\d{2}$")]
    """When the flight ended."""
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
        """Return what is known, by the vehicle's name."""
        return {one.name: _parse_known(one) for one in self.vehicles}


def read_learned(path: Path) -> LearnedDocument:
    """Read learned.json.

    Raises:
        LogError: one line that names the file, the key and what was expected.
    """
    return LearnedDocument.read(path, "what a flight taught about its vehicles")


def read_learned_before(run: Path) -> Mapping[str, KnownVehicle]:
    """Return what a flight began with, by its run directory.

    Raises:
        LogError: the file cannot be used.
    """
    path = RunDirectory(run).learned_before
    return read_learned(path).known_by_name if path.exists() else MappingProxyType({})


def build_learned_document(known: Mapping[str, KnownVehicle], date: str) -> LearnedDocument:
    """Return the content of learned.json."""
    return LearnedDocument(
        format="faultline-learned/1", date=date, vehicles=tuple(_build_part(name, one) for name, one in known.items())
    )


def learn_from_flight(
    context: Context, state: FleetState, before: Mapping[str, KnownVehicle], date: str
) -> LearnedDocument:
    """Return what is known of a fleet after a flight.

    Args:
        context: Of the flight.
        state: At its end.
        before: What the flight began with, by the vehicle's name.
        date: Of its end.
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
    """Return in one line what is known of a vehicle."""

    def of(part: PacePart | ConsumptionPart) -> str:
        return f"{100 * part.mean:.0f} ± {100 * part.sd:.0f} %"

    return (
        f"{vehicle.name}: inspections take {of(vehicle.inspect)} of the model's time, transits {of(vehicle.transit)}, "
        f"consumption {of(vehicle.consumption)}, from {vehicle.inspect.legs + vehicle.transit.legs} legs"
    )


def _build_part(name: str, known: KnownVehicle) -> LearnedVehicle:
    return LearnedVehicle.build_from(
        known,
        name=name,
        inspect=PacePart.build_from(known.inspect),
        transit=PacePart.build_from(known.transit),
        consumption=ConsumptionPart.build_from(known.consumption, mean=known.consumption.factor, minutes=known.minutes),
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
