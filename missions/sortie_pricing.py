"""Days of sorties as they are flown: the planning problem of a network from several bases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from missions.flight_model import UNKNOWN, Base
from missions.geo import FloatArray
from missions.pricing import PricedMoves, Pricing, VehicleMoves
from planner.sorties import SortieBase, SortieInstance, SortieVehicle

Window = tuple[float, float]


def build_priced_sorties(
    pricing: Pricing,
    vehicles: Sequence[SortieVehicle],
    pads: Sequence[Sequence[Base]],
    bases: Sequence[SortieBase],
    days: Sequence[Window],
    transfer_s: FloatArray,
    *,
    able: npt.NDArray[np.bool_] | None = None,
    stagger_s: float = 0.0,
) -> SortieInstance:
    """Return the planning problem of all segments of a pricing; ways are straight, moves priced when asked for.

    Args:
        pricing: Of at least these vehicles.
        vehicles: The fleet; their profiles are set here.
        pads: For each vehicle its pad at each base.
        bases: Packs and times.
        days: When may be flown at all.
        transfer_s: Between bases, on the ground.
        able: (k, n), whose camera is good for which segment; by default everybody's for all.
        stagger_s: The least time between two take-offs from a base.

    Raises:
        planner.InstanceError: what does not fit.
    """
    tracks_m = pricing.tracks_m.reshape(-1, 2, 3)
    first_m, last_m = tracks_m.reshape(-1, 3), np.array(tracks_m[:, ::-1].reshape(-1, 3))
    fliers = [VehicleMoves(pricing.models[own.name]) for own in vehicles]
    profiles = tuple(dict.fromkeys(fliers))
    fleet, visits = len(vehicles), len(first_m)
    out, home = np.zeros((2, fleet, len(bases), visits)), np.zeros((2, fleet, visits, len(bases)))
    for row, (own, flier) in enumerate(zip(vehicles, fliers, strict=True)):
        factors = np.array([1.0, own.consumption])[:, np.newaxis]
        for place, pad in enumerate(pads[row]):
            climb = np.array(flier.model.price_take_off(np.array(pad.climb_m)))[:, np.newaxis]
            there = np.array(flier.price_moves(np.array(pad.place_m), UNKNOWN, first_m, last_m))
            out[:, row, place] = factors * (there + climb)
            home[:, row, :, place] = factors * np.array(flier.price_ways_home(last_m, last_m - first_m, pad))
    return SortieInstance(
        moves=PricedMoves(first_m, last_m, profiles),
        bases=tuple(bases),
        vehicles=tuple(
            replace(own, profile=profiles.index(flier)) for own, flier in zip(vehicles, fliers, strict=True)
        ),
        days=tuple(days),
        out_s=out[0], out_pct=out[1], home_s=home[0], home_pct=home[1],
        transfer_s=transfer_s,
        able=np.ones((fleet, visits // 2), dtype=np.bool_) if able is None else able,
        wanted=np.ones(visits // 2, dtype=np.bool_),
        stagger_s=stagger_s,
    )  # fmt: skip
