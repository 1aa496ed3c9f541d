"""packs.json: what replayed flights say of packs, one entry a flight; further logs add to it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from executor.replay.pack_book import PackFlight
from executor.replay.replay_result import LogReplay
from executor.site.learned_files import FORMAT, PackEntry, PacksDocument


def merge_packs(
    replays: Iterable[LogReplay],
    before: PacksDocument | None = None,
    labels: Mapping[int, str] = MappingProxyType({}),
) -> PacksDocument:
    """Return what is known after further logs; a flight that was known is told anew.

    Args:
        replays: The logs.
        before: What was known.
        labels: What stands on the pack of each system; a log in which one changes its pack says it of none.
    """
    known = {} if before is None else {_key_of(one): one for one in before.flights}
    for replayed in replays:
        for vehicle in replayed.vehicles:
            label = labels.get(vehicle.sysid) if all(flight.number == 1 for flight in vehicle.packs) else None
            for flight in vehicle.packs:
                entry = _build_entry(replayed, vehicle.name, flight)
                was = known.get(_key_of(entry))
                told = label if label is not None or was is None else was.label
                known[_key_of(entry)] = entry.model_copy(update={"label": told})
    return PacksDocument(format=FORMAT, flights=tuple(known[key] for key in sorted(known)))


def _key_of(entry: PackEntry) -> tuple[str, str, int]:
    return entry.vehicle, entry.log, entry.began_usec


def _build_entry(replayed: LogReplay, vehicle: str, flight: PackFlight) -> PackEntry:
    least_ah, most_ah = flight.capacity_ah or (None, None)
    return PackEntry(
        log=replayed.path.name,
        vehicle=vehicle,
        pack=flight.number,
        began_usec=replayed.began_usec + round(flight.began_s * 1e6),
        minutes=round((flight.ended_s - flight.began_s) / 60.0, 2),
        cells=flight.cells,
        rest_cell_v=_round_value(flight.began_cell_v),
        end_cell_v=round(flight.ended_cell_v, 3),
        began_pct=flight.began_pct,
        ended_pct=flight.ended_pct,
        sag_cell_v=_round_value(flight.sag_cell_v),
        ohm=_round_value(flight.ohm, 4),
        ohm_sd=_round_value(flight.ohm_sd, 4),
        counted_ah=_round_value(flight.counted_ah),
        set_ah=_round_value(flight.set_ah),
        least_ah=_round_value(least_ah, 2),
        most_ah=_round_value(most_ah, 2),
    )


def _round_value(value: float | None, digits: int = 3) -> float | None:
    return None if value is None else round(value, digits)


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
