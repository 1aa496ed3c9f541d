"""Writes the site of a fleet in containers: its site file, and where each vehicle stands.

The pattern is a site file with one vehicle. Vehicle number i of the fleet, counted from 0, is that vehicle with i more
on its number, its system and its port. The pads are the ones that faultline chooses around the depot, a line of
latitude, longitude and height each, so that simulators outside of this image can be started on them.
"""

from __future__ import annotations

import argparse
import os
import sys
import tomllib
from pathlib import Path
from urllib.parse import urlsplit

import tomlkit

from executor.errors import ExecutorError
from executor.simulated.simulated_fleet import SIMULATED_CEILING_M, USUAL_VEHICLES
from executor.site import site_model
from executor.site.site_file import check_site
from missions import MissionsError
from missions.files import write_whole


def fleet(pattern: dict[str, object], vehicles: int, speedup: float, page: str | None = None) -> dict[str, object]:
    """Return the site of a fleet."""
    if vehicles < 1:
        raise ValueError(f"--vehicles {vehicles}: expected at least one vehicle")
    tables = pattern["vehicle"]
    if not isinstance(tables, list) or len(tables) != 1:
        raise ValueError("vehicle: expected one table, the pattern")
    first = tables[0]
    url = urlsplit(first["connection"])
    made = []
    for number in range(vehicles):
        connection = f"{url.scheme}://{url.hostname}:{(url.port or 0) + number}"
        made.append(first | {"name": f"uav{number + 1}", "sysid": number + 1, "connection": connection})
    flight, inspection = pattern.get("flight", {}), pattern.get("inspection", {})
    changed = {"flight": {**flight, "speedup": speedup}, "vehicle": made}  # type: ignore[dict-item]
    if vehicles > USUAL_VEHICLES:
        # So many layers reach above 120 m; what flies in containers is simulated and needs no permit.
        changed["inspection"] = {"ceiling_m": SIMULATED_CEILING_M, **inspection}  # type: ignore[dict-item]
    if page is not None:
        changed["web"] = {**pattern.get("web", {}), "address": page}  # type: ignore[dict-item]
    return pattern | changed


def main() -> int:
    """Write site.toml and pads; returns 2 with one line if that cannot be done."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pattern", type=Path, help="a site file with one vehicle")
    parser.add_argument("--vehicles", type=int, default=4)
    parser.add_argument("--speedup", type=float, default=1.0)
    parser.add_argument("--page", metavar="URL", help="where browsers reach the page of the flight")
    parser.add_argument("--into", type=Path, required=True, metavar="DIR")
    given = parser.parse_args()
    try:
        content = fleet(
            tomllib.loads(given.pattern.read_text(encoding="utf-8")), given.vehicles, given.speedup, given.page
        )
        ground = site_model.load_site_model(check_site(content, str(given.pattern)), given.pattern.parent)
        frame = ground.network.frame
        pads = [(*frame.to_wgs84_deg(pad.east_m, pad.north_m), pad.alt_m) for pad in ground.setup.pads]
        lines = [f"{lat_deg:.7f} {lon_deg:.7f} {alt_m:.1f}\n" for lat_deg, lon_deg, alt_m in pads]
        # podman may run this again while the vehicles start: they read a whole file then.
        write_whole(given.into / "site.toml", tomlkit.dumps(content).encode())
        write_whole(given.into / "pads", "".join(lines).encode())
    except (OSError, ValueError, ExecutorError, MissionsError) as error:
        print(f"prepare: {given.pattern}: {error}", file=sys.stderr)
        return 2
    print(f"{given.vehicles} vehicles, {given.into / 'site.toml'}")
    if given.page is not None:
        token = os.environ.get("FAULTLINE_WEB_TOKEN", "")
        print(f"page, once the flight is prepared: {given.page}{f'?token={token}' if token else ''}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
