"""The site that a demo makes for itself."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import tomlkit

from executor.adapters.run_directory import RunDirectory
from executor.simulated.simulated_fleet import build_demo_site, find_free_ports, fleet_of, run_simulated_fleet
from executor.site import site_model
from executor.site.site_file import check_site
from missions import default_network_path, read_network

SYDNEY = (-33.86, 151.21)


def site_over(network: Path | None, *, flat: bool = False) -> site_model.SiteModel:
    content = build_demo_site(network=network, radius_m=700, vehicles=3, speedup=10, autopilot="px4", flat=flat)
    return site_model.load_site_model(check_site(content, "demo"), Path())


def test_the_default_network_lies_where_it_says() -> None:
    ground = site_over(None)
    assert len(ground.network.segments) == 33
    assert ground.names == ("uav1", "uav2", "uav3")


def test_a_geojson_network_keeps_its_own_depot(tmp_path: Path) -> None:
    lat_deg, lon_deg = SYDNEY
    depot = {"type": "Point", "coordinates": [lon_deg, lat_deg]}
    features = [
        {"type": "Feature", "properties": {"role": "depot"}, "geometry": depot},
        {
            "type": "Feature",
            "properties": {},
            "geometry": {
                "type": "LineString",
                "coordinates": [[lon_deg + 0.001, lat_deg], [lon_deg + 0.003, lat_deg], [lon_deg + 0.005, lat_deg]],
            },
        },
    ]  # fmt: skip
    network = tmp_path / "sydney.geojson"
    network.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    ground = site_over(network, flat=True)
    assert (ground.network.frame.lat_deg, ground.network.frame.lon_deg) == SYDNEY
    assert len(ground.network.segments) == 2


def test_a_graph_file_is_put_where_the_default_network_is(tmp_path: Path) -> None:
    network = tmp_path / "graph.yaml"
    network.write_text('pylons_position: "100 0 0;\n200 0 0;";\n\nconnections_indexes: "2;\n1;";\n')
    ground = site_over(network)
    assert ground.network.frame == read_network(default_network_path()).frame
    assert len(ground.network.segments) == 1


@pytest.mark.parametrize(("ours", "other"), [(255, 254), (254, 253), (7, 254)])
def test_simulated_vehicles_watch_our_own_number_and_another_station_has_another(ours: int, other: int) -> None:
    content = build_demo_site(network=None, radius_m=700, vehicles=2, speedup=10, autopilot="ardupilot", flat=False)
    ground = site_model.load_site_model(check_site(content | {"link": {"station_sysid": ours}}, "demo"), Path())
    fleet = fleet_of(ground, speedup=10, faults=(), seed=0, wind=1.0, failsafe=True)
    assert [(one.parameters["MAV_GCS_SYSID"], one.other_station) for one in fleet.vehicles] == [(ours, other)] * 2


def test_the_ports_of_a_fleet_are_none_that_the_system_chooses() -> None:
    ports = find_free_ports(200)
    assert len(set(ports)) == 200
    assert max(ports) < 32_768


def test_only_the_usual_demo_has_budgets_of_its_own() -> None:
    def budgets(radius_m: float) -> set[float]:
        content = build_demo_site(network=None, radius_m=radius_m, vehicles=4, speedup=10, autopilot="px4")
        return {vehicle.budget_pct for vehicle in check_site(content, "demo").vehicle}

    assert budgets(700.0) == {28.0} != budgets(900.0)


def test_a_flight_begins_when_its_simulated_fleet_is_there_however_slow_the_computer(tmp_path: Path) -> None:
    content = build_demo_site(network=None, radius_m=700, vehicles=2, speedup=10, autopilot="px4", flat=False)
    RunDirectory(tmp_path).site.write_text(tomlkit.dumps(content), encoding="utf-8")
    with run_simulated_fleet(tmp_path, [], seed=1):
        assert RunDirectory(tmp_path).truths.exists()


def test_a_simulated_fleet_that_cannot_start_is_not_waited_for(tmp_path: Path) -> None:
    RunDirectory(tmp_path).site.write_text("no site", encoding="utf-8")
    with run_simulated_fleet(tmp_path, [], seed=1):
        assert (tmp_path / "simulator.log").read_text(encoding="utf-8").startswith("faultline: ")
