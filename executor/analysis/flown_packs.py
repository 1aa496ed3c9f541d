"""What a flight says of its packs, as entries of packs.json."""

from __future__ import annotations

from executor.core.state.fleet_state import FleetState
from executor.site.site_packs import FORMAT, PackEntry, PacksDocument

USEC = 1e6


def build_flown_packs(state: FleetState, log: str, began_unix_s: float) -> PacksDocument:
    """Return what the sorties of a flight say of the packs that the crew named, or changed.

    Args:
        state: At its end.
        log: The name of its run directory.
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
            # A pack without a label is another one for each sortie: nobody knows better.
            number = numbers.setdefault((one.pack, 0 if one.pack else at), len(numbers) + 1)
            entries.append(
                PackEntry.build_from(
                    one,
                    log=log,
                    vehicle=name,
                    pack=number,
                    label=one.pack or None,
                    began_usec=round((began_unix_s + one.began_s) * USEC),
                    minutes=round((one.ended_s - one.began_s) / 60.0, 2),
                    rest_cell_v=None if one.rest_v is None else round(one.rest_v / one.cells, 3),
                    end_cell_v=round(one.end_v / one.cells, 3),
                )
            )
    return PacksDocument(format=FORMAT, flights=tuple(entries))
