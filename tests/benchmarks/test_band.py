"""Whether the band holds: what is drawn, what is seen of one flight, and what is made of many."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks import band
from benchmarks.band import TENTHS, BandFlight, BandRoute, Sight, band_cases, band_held, fly_band
from benchmarks.predictionpage import join_content, report_prediction
from benchmarks.predictionpage import prediction_document as document
from tests.benchmarks.virtual.short_line import write_line

NOTHING = document([], "faultline bench prediction", seed=1)


def route(landed_pct: float, reserve_pct: float = 30.0, **changes: object) -> BandRoute:
    """Return one that was predicted to land with 40 % and a band of 2 points at every tenth."""
    sights = tuple(Sight(tenth, 40.0, 1.2, 2.0) for tenth in range(TENTHS))
    found = BandRoute("uav1", "px4", landed_pct, reserve_pct, sights, None, None)
    return replace(found, **changes)  # type: ignore[arg-type]


def test_routes_are_drawn_as_asked() -> None:
    drawn = band_cases(30, 1, ["ardupilot", "px4"])
    sizes = [size for case in drawn for size in case.sizes]
    assert (len(sizes), min(sizes), max(sizes)) == (30, *band.SEGMENTS)
    assert band_cases(30, 1, ["px4"]) != band_cases(30, 2, ["px4"])


def test_what_lies_within_the_band_is_held() -> None:
    flights = [BandFlight((route(38.0), route(42.0)), 100.0, 1.0), BandFlight((route(42.1),), 100.0, 1.0)]
    held = band_held([*flights, BandFlight((), 50.0, 1.0, "uav1: falls")])
    assert [row["held"] for row in held["tenths"]] == [0.667] * TENTHS
    assert held["tenths"][3] == {
        "tenth": 3, "routes": 3, "held": 0.667, "band_pct": 2.0, "error_pct": 2.0, "bias_pct": 2.0,
    }  # fmt: skip
    assert held["not_counted"] == ["uav1: falls"]


def test_a_saying_is_wrong_where_it_landed_above() -> None:
    warned = {"warned_s": 60.0}
    routes = (
        route(40.0), route(40.0, **warned), route(30.0, faulted_s=70.0, **warned), route(29.9, **warned), route(20.0)
    )  # fmt: skip
    held = band_held([BandFlight(routes, 100.0, 1.0)])
    assert held["above"] == {"routes": 3, "warned": 2, "faults": 1}
    assert held["below"] == {"routes": 2, "warned": 1, "faults": 0}
    page = report_prediction({**NOTHING, "band": {"machine": NOTHING["machine"], "command": "x", **held}}).page()
    assert "| above their reserve | 3 | 2 | 1 | 66.7 | 33.3 |" in page
    assert "| 3/10 | 5 | 40.0 | 2.00 | 10.00 | -10.00 |" in page


def test_what_a_run_did_not_measure_is_kept() -> None:
    both = {**NOTHING, "routes": 40, "band": {"routes": 200}}
    assert join_content(both, {**NOTHING, "band": {"routes": 10}}) == {**both, "band": {"routes": 10}}
    assert join_content(both, {**NOTHING, "routes": 5}) == {**NOTHING, "routes": 5, "band": {"routes": 200}}


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> BandFlight:
    line = write_line(tmp_path_factory.mktemp("line") / "line.geojson")
    return fly_band(replace(band_cases(1, 1, ["ardupilot"])[0], network=Path(line), sizes=(5,)))


def test_a_flight_is_seen_from_its_first_tenth_to_its_last(flown: BandFlight) -> None:
    [found] = flown.routes
    assert flown.wrong == ""
    assert [sight.tenth for sight in found.sights] == list(range(len(found.sights)))
    assert len(found.sights) >= TENTHS - 1
    assert found.sights[0].sd_pct > 3.0 * found.sights[-1].sd_pct
    assert all(sight.band_pct == pytest.approx(1.5 * sight.sd_pct) for sight in found.sights)
    assert abs(found.sights[-1].landing_pct - found.landed_pct) < 1.0
