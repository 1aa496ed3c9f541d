"""Two simulated vehicles with one system id behind one radio are detected."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from benchmarks.errors import FlightNotFlown
from benchmarks.virtual.radio import MemoryRadio, share_port
from benchmarks.virtual_flight import VirtualRun, fly_virtual
from benchmarks.virtual_site import build_virtual_site
from executor.core.interface.ports import OpenLink
from simulator.config import SimVehicle
from simulator.fleet import SimulatedVehicle
from simulator.radio import Radio, parse_radio
from tests.benchmarks.virtual.short_line import shared, write_line


class TwinRun(VirtualRun):
    """A flight of one vehicle, with a second one of its number behind the same radio."""

    def __init__(self, *args: object, apart_m: float, later_s: float) -> None:
        """Prepare; the arguments are those of a `VirtualRun`."""
        configs: list[SimVehicle] = []

        def note(config: SimVehicle) -> SimVehicle:
            configs.append(config)
            return config

        ground, plan, faults, seed, _, onlookers = args
        super().__init__(ground, plan, faults, seed, note, onlookers)  # type: ignore[arg-type]
        [config], radio = configs, Radio(parse_radio("sik"), range(2))
        twin = replace(config, name="other", home_lat_deg=config.home_lat_deg + apart_m / 111_320)
        pair = [MemoryRadio(SimulatedVehicle(one, (), (radio,), place), 1) for place, one in enumerate((config, twin))]
        pair[1].vehicle.autopilot.boot_s = -later_s
        share_port(pair[::-1])
        self.radios = {"other": pair[1], "uav1": pair[0]}

    @property
    def links(self) -> Mapping[str, OpenLink]:  # type: ignore[override]
        return {"uav1": self.radios["uav1"].end}


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
@pytest.mark.parametrize(
    ("apart_m", "later_s"), [(6.0, 0.0), (0.5, 40.0)], ids=["switched on together", "side by side"]
)
def test_nothing_is_flown(autopilot: str, apart_m: float, later_s: float, tmp_path: Path) -> None:
    ground = build_virtual_site(write_line(tmp_path / "line.geojson"), None, 1, autopilot)
    with pytest.raises(FlightNotFlown, match="uav1: two vehicles use its system id"):
        fly_virtual(
            ground, shared(ground), seed=1, limit_s=60.0, make=partial(TwinRun, apart_m=apart_m, later_s=later_s)
        )
