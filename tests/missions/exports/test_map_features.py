"""What is drawn for maps: no format is given a figure that it has no word for."""

from __future__ import annotations

import math

import pytest

from missions import MissionFileError
from missions.exports import MapFeatureKind, MapFeatures, MapLine, MapLinePiece, MapPoint, Reference


def way(up_m: float, energy_pct: float = 20.0) -> MapLine:
    pieces = (MapLinePiece(((49.6, 15.6, 450.0), (49.6, 15.7, up_m))),)
    return MapLine(MapFeatureKind.PLANNED, "uav1 planned", pieces, Reference.SEA, "uav1", {"energy_pct": energy_pct})


def test_what_is_finite_is_drawn() -> None:
    assert MapFeatures("plan", ("uav1",), (way(460.0),), ()).ways


@pytest.mark.parametrize("spoilt", [way(math.nan), way(math.inf), way(460.0, energy_pct=math.nan)])
def test_what_is_not_finite_is_refused(spoilt: MapLine) -> None:
    with pytest.raises(MissionFileError, match=r"^plan: uav1 planned: expected finite figures, got (nan|inf)$"):
        MapFeatures("plan", ("uav1",), (spoilt,), ())


def test_a_place_without_a_finite_height_is_refused_and_one_without_any_is_not() -> None:
    MapFeatures("plan", (), (), (MapPoint(MapFeatureKind.PAD, "pad", (49.6, 15.6, None), Reference.NONE),))
    with pytest.raises(MissionFileError, match=r"^plan: pad: expected finite figures, got nan$"):
        MapFeatures("plan", (), (), (MapPoint(MapFeatureKind.PAD, "pad", (49.6, math.nan, None), Reference.NONE),))
