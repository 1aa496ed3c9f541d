"""The crew at the bases of a day in virtual time: swaps the packs of landed vehicles, and confirms it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping

from executor.core.ground import turnaround
from executor.core.interface.intents import Action, Intent, IntentRecord
from executor.core.state.bases import is_at_closed_base
from executor.runtime.flight_loop import Flight
from simulator.fault_kinds import parse_fault
from simulator.fleet import SimulatedVehicle

BESIDE_S = 10.0
"""Time until a crew member reaches a landed vehicle."""
CONNECTED_S = 5.0
"""Time from power-off to the crew's confirmation of another pack: the vehicle is booting then."""
PackId = str
Packs = Callable[[str], tuple[PackId, float] | None]
"""Return a vehicle's next pack: its id and true charge in percent; None if there are no more."""


class PadCrew:
    """The crew of all bases."""

    def __init__(self, vehicles: Mapping[str, SimulatedVehicle], packs: Packs, *, confirms: bool = True) -> None:
        """Create the crew.

        Args:
            vehicles: All vehicles.
            packs: Packs to install.
            confirms: Whether it confirms a swap.
        """
        self.asked: list[IntentRecord] = []
        """Requests, with their immediate answers."""
        self._vehicles, self._packs, self._confirms = vehicles, packs, confirms
        self._numbered = itertools.count(1)
        self._rests_s: dict[str, float] = {}
        self._changed: dict[str, tuple[float, PackId]] = {}

    def attend(self, flight: Flight, now_s: float) -> None:
        """Go to each vehicle waiting on a base, swap its pack, and confirm while the vehicle boots."""
        for name in self._vehicles:
            self._attend(flight, name, now_s)

    def swap(self, flight: Flight, name: str, pack: PackId, *, confirmed: bool = True) -> IntentRecord:
        """Confirm a vehicle's pack swap."""
        intent = Intent(f"swap-{next(self._numbered)}", Action.SWAP, name, "page", confirmed, pack)
        record = flight.submit_intent(intent)
        self.asked.append(record)
        return record

    def _attend(self, flight: Flight, name: str, now_s: float) -> None:
        vehicle = flight.state.vehicles[name]
        waits = (
            turnaround.is_in_service(flight.context, flight.state, vehicle, now_s)
            and vehicle.turn.asked_s is None
            and bool(vehicle.turn.sorties)
        )
        waits = waits and not is_at_closed_base(flight.context, flight.state, vehicle)
        since_s = self._rests_s.setdefault(name, now_s) if waits else self._rests_s.pop(name, now_s)
        if name in self._changed:
            changed_s, pack = self._changed[name]
            if self._confirms and waits and now_s - changed_s >= CONNECTED_S:
                del self._changed[name]
                self.swap(flight, name, pack)
        elif waits and now_s - since_s >= BESIDE_S and self._has_more(flight, name, now_s):
            found = self._packs(name)
            if found is not None:
                pack, held_pct = found
                self._vehicles[name].apply_injection(parse_fault(f"{name}:pack={held_pct:g}@0s"))
                self._changed[name] = now_s, pack

    def _has_more(self, flight: Flight, name: str, now_s: float) -> bool:
        """Return whether a vehicle is shown as waiting for a pack, or no day was planned."""
        context, state = flight.context, flight.state
        return context.day is None or bool(
            turnaround.describe_awaited_sortie(context, state, state.vehicles[name], now_s)
        )
