"""The flights of one vehicle in a log: which of them had a mission, and so could be interrupted."""

from __future__ import annotations

from dataclasses import dataclass, field

from executor.core.state.vehicle_state import VehicleState


@dataclass(slots=True)
class _Flight:
    """From one arming to the next."""

    began_s: float
    took_off: bool = False
    mission: bool = False


@dataclass(slots=True)
class FlightBook:
    """What is noted of a vehicle's flights."""

    flights: list[_Flight] = field(default_factory=list)

    def begin_flight(self, at_s: float) -> None:
        """Begin a flight."""
        self.flights.append(_Flight(at_s))

    def update(self, vehicle: VehicleState) -> None:
        """Take note of what the flight under way is."""
        if not self.flights or not vehicle.armed:
            return
        flight = self.flights[-1]
        flight.took_off |= vehicle.sortie.took_off
        flight.mission |= vehicle.sortie.flew_mission

    def describe_missionless(self, name: str) -> str:
        """Return in words which flights had no mission; nothing if all had one."""
        flown = [one for one in self.flights if one.took_off]
        by_hand = [one for one in flown if not one.mission]
        if not by_hand:
            return ""
        which = "flown" if len(flown) == 1 else f"{len(by_hand)} of its {len(flown)} flights"
        since = f"at {by_hand[0].began_s:.1f} s" if len(by_hand) == 1 else f"the first at {by_hand[0].began_s:.1f} s"
        what = "no inspection that could be interrupted; its battery, its link and a crash are watched for"
        return f"{name}: {which} by hand, or without a mission ({since}): {what}"
