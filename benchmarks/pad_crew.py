"""Who stands by at the bases of a day in virtual time: changes the packs of those who have landed, and says so."""

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
"""Until somebody stands beside a vehicle that has landed."""
CONNECTED_S = 5.0
"""So long after its power went the crew says that another pack is in: it is booting then."""
PackId = str
Packs = Callable[[str], tuple[PackId, float] | None]
"""Gives a vehicle's next pack: its id and what it really holds, in percent; None where there is no more."""


class PadCrew:
    """The crew of all bases."""

    def __init__(self, vehicles: Mapping[str, SimulatedVehicle], packs: Packs, *, confirms: bool = True) -> None:
        """Stand by.

        Args:
            vehicles: Everybody.
            packs: What is put in.
            confirms: Whether it says that a pack is changed.
        """
        self.asked: list[IntentRecord] = []
        """What was asked for, with the answer that came at once."""
        self._vehicles, self._packs, self._confirms = vehicles, packs, confirms
        self._numbered = itertools.count(1)
        self._rests_s: dict[str, float] = {}
        self._changed: dict[str, tuple[float, PackId]] = {}

    def attend(self, flight: Flight, now_s: float) -> None:
        """Go to everybody who waits on a base, change the pack, and say so while the vehicle boots."""
        for name in self._vehicles:
            self._attend(flight, name, now_s)

    def swap(self, flight: Flight, name: str, pack: PackId, *, confirmed: bool = True) -> IntentRecord:
        """Say that a vehicle's pack is changed."""
        intent = Intent(f"swap-{next(self._numbered)}", Action.SWAP, name, "page", confirmed, pack)
        record = flight.submit_intent(intent)
        self.asked.append(record)
        return record

    def _attend(self, flight: Flight, name: str, now_s: float) -> None:
        vehicle = flight.state.vehicles[name]
        waits = turnaround.is_in_service(vehicle) and vehicle.turn.asked_s is None and bool(vehicle.turn.sorties)
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
        """Return whether the crew reads of a vehicle that it waits for a pack, or nobody planned a day."""
        context, state = flight.context, flight.state
        return context.day is None or bool(
            turnaround.describe_awaited_sortie(context, state, state.vehicles[name], now_s)
        )
