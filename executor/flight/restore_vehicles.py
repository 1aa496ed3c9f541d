"""Vehicles are given back what a flight changed on them, from its run directory, whatever became of the flight."""

from __future__ import annotations

from pathlib import Path

from executor.adapters.clock import SystemClock
from executor.adapters.mavlink import endpoints
from executor.adapters.run_directory import RunDirectory, lock_run_directory
from executor.core.interface.ports import Keyring, LinkRequest
from executor.core.preflight.parameter_proposals import KeptParameter
from executor.errors import LogError
from executor.flight import fencing
from executor.flight.flight_request import Console
from executor.flight.kept_lists import KeptList, read_kept_lists
from executor.flight.kept_parameters import read_kept_parameters
from executor.flight.parameter_changes import restore_kept_parameters
from executor.flight.simulation_clock import follow_fleet_time
from executor.site.site_file import Site, read_signing_key, read_site


def read_open_changes(run: Path) -> tuple[Site, list[KeptParameter], list[KeptList]]:
    """Return the site of a flight, and which parameters, fences and rally points have still to be given back.

    Raises:
        LogError: the directory holds no record, or one that cannot be read.
        SiteError: site.toml cannot be used.
    """
    kept, lists = read_kept_parameters(run), read_kept_lists(run)
    if kept is None and not lists:
        raise LogError(f"{run}: expected a run directory with parameters.json; no parameter was changed from here")
    still = [one for one in kept or () if one.open]
    return read_site(RunDirectory(run).site), still, [one for one in lists if one.is_open]


async def restore_from_run(run: Path, console: Console) -> tuple[tuple[KeptParameter, ...], tuple[KeptList, ...]]:
    """Give back what is on record; returns both records as they are then.

    Nobody hears a heartbeat from here: a vehicle that somebody flies would take its end for a lost ground station.

    Raises:
        LogError: another process flies from this directory, or it holds no record.
        SiteError: site.toml cannot be used, or the signing key is missing.
        ConnectionFailed: a connection cannot be opened.
    """
    with lock_run_directory(run):
        site, waiting, lists = read_open_changes(run)  # now that nobody else writes to it
        names = {one.vehicle for one in waiting} | {one.vehicle for one in lists}
        async with follow_fleet_time(site, console) as found:
            clock = SystemClock.start_on(site.flight.speedup, found.steady)
            key = read_signing_key(site, run)
            keyring = None if key is None else Keyring(key, clock.steady_unix_s)
            # One way for all: it is the same connection, whichever software spoke to the vehicle in flight.
            wanted = {table.name: LinkRequest(table.link, table.sysid) for table in site.vehicle if table.name in names}
            async with endpoints.open_mavlink_links(wanted, keyring) as links:
                heard_s = site.flight.connect_timeout_s * clock.speedup
                fences = await fencing.restore_kept_lists(run, links, clock, console, heard_s)
                return await restore_kept_parameters(run, links, clock, console, heard_s), fences
