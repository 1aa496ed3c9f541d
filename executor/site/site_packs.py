"""packs.json: what flights said of packs, and of it the packs that a site's vehicles fly with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from executor.adapters.document import Document, Number, Whole
from executor.core.battery.pack_condition import PackFlightRecord, PackHistory, build_pack_history
from executor.site.site_file import Site

FORMAT: Literal["faultline-packs/1"] = "faultline-packs/1"
UNIX_USEC = 10**15
"""A log's clock that shows less does not say on which day it was."""


class PackEntry(Document):
    """One flight of one pack; None where the log does not say."""

    log: str
    """Its file's name."""
    vehicle: str
    pack: Annotated[Whole, Field(ge=1)]
    """Which of the vehicle's packs in this log, from 1."""
    label: str | None = None
    """What stands on the pack: `pack` of the vehicle in the site file that it was replayed with."""
    began_usec: Whole
    """By the log's clock."""
    minutes: Number
    cells: Annotated[Whole, Field(ge=1)]
    rest_cell_v: Number | None
    """Before the flight."""
    end_cell_v: Number
    """At its end, as it would rest."""
    began_pct: Number
    ended_pct: Number
    """By its own report."""
    sag_cell_v: Number | None = None
    ohm: Number | None = None
    ohm_sd: Number | None = None
    counted_ah: Number | None = None
    set_ah: Number | None = None
    """What its autopilot counts by."""
    least_ah: Number | None = None
    most_ah: Number | None = None
    """Its capacity by its voltage, within what the chemistry and the curves leave open."""


class PacksDocument(Document):
    """What is known of packs."""

    format: Literal["faultline-packs/1"]
    flights: tuple[PackEntry, ...]


def read_packs(path: Path) -> PacksDocument:
    """Read packs.json.

    Raises:
        LogError: one line that names the file, the key and what was expected.
    """
    return PacksDocument.read(path, "what flights taught about packs")


@dataclass(frozen=True, slots=True)
class SitePacks:
    """What is known of a site's packs."""

    fitted: Mapping[str, PackHistory] = field(default_factory=dict)
    """Those that vehicles begin with, by the vehicles' names."""
    labelled: Mapping[str, PackHistory] = field(default_factory=dict)
    """All of which a flight is known, and those that vehicles begin with, by their labels."""


def load_site_packs(site: Site, base: Path) -> SitePacks:
    """Return what is known of the packs that vehicles fly with.

    Raises:
        LogError: the file that `energy.packs` names cannot be used.
    """
    if site.energy.packs is None:
        return SitePacks()
    flights = read_packs(base / site.energy.packs).flights
    begins = {one.name: one.pack for one in site.vehicle if one.pack is not None}
    labels = {one.label for one in flights if one.label} | set(begins.values())
    known = {label: _build_history(label, flights) for label in sorted(labels)}
    return SitePacks({name: known[label] for name, label in begins.items()}, known)


def _build_history(label: str, flights: tuple[PackEntry, ...]) -> PackHistory:
    # Logs without a date come first: nobody knows how old they are.
    mine = sorted(
        (one for one in flights if one.label == label),
        key=lambda one: one.began_usec if one.began_usec >= UNIX_USEC else 0,
    )
    return build_pack_history(label, [PackFlightRecord(one.most_ah, one.ohm, one.set_ah) for one in mine])
