"""What a run directory keeps of the ground is what the crew saw, and small; damage is said in a line."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from executor.errors import LogError
from executor.site.ground_view import (
    DOCUMENT,
    PHOTO,
    PHOTO_BYTES,
    RELIEF,
    GroundDocument,
    GroundView,
    encode_ground,
    read_ground_files,
    write_ground,
)
from missions.readers.background_files import Background
from tests.executor.grounds import Hills, ground_about
from tests.missions.builders import FRAME

PLACES_M = np.array([(100.0, 0.0), (700.0, 250.0)])


def test_what_was_kept_is_read_back(tmp_path: Path) -> None:
    view = ground_about(PLACES_M, hills=Hills(unknown_east_m=800.0))
    write_ground(tmp_path, view, FRAME)
    assert {path.name for path in tmp_path.iterdir()} == {DOCUMENT, PHOTO, RELIEF}
    files = read_ground_files(tmp_path)
    assert files == encode_ground(view, FRAME)
    document = GroundDocument.model_validate_json(files[DOCUMENT])
    assert (document.low_m, document.high_m, document.attribution) == (view.low_m, view.high_m, "© Land survey 2026")
    assert view.background is not None
    photo = np.asarray(Image.open(io.BytesIO(files[PHOTO])).convert("RGBA"))
    assert np.abs(photo.astype(int) - view.background.pixels.astype(int)).mean() < 12.0  # it is a little less exact
    assert view.relief is not None
    assert document.relief is not None
    assert (np.asarray(Image.open(io.BytesIO(files[RELIEF])).convert("LA")) == view.relief.shade).all()
    assert (document.relief.contours, document.relief.interval_m) == (view.relief.contours, view.relief.interval_m)
    heights = document.relief.heights
    east_m = np.linspace(view.low_m[0], view.high_m[0], 2 * heights.columns + 1)[1::2]
    north_m = np.linspace(view.high_m[1], view.low_m[1], 2 * heights.rows + 1)[1::2]
    kept_m = np.array(heights.metres, dtype=np.float64).reshape(heights.rows, heights.columns)
    known = ~np.isnan(kept_m)
    assert kept_m[known] == pytest.approx(Hills().grid_m(east_m, north_m)[known], abs=4.0)
    assert not known.all()


def test_where_the_local_metres_are_is_known_between_the_lattice_to_a_tenth_of_a_metre() -> None:
    view = GroundView((-12_000.0, -9_000.0), (11_000.0, 14_000.0))
    degrees = json.loads(encode_ground(view, FRAME)[DOCUMENT])["degrees"]
    lat_deg, lon_deg = (
        np.array(degrees[key]).reshape(degrees["rows"], degrees["columns"]) for key in ("lat_deg", "lon_deg")
    )
    # In the middle of each cell of the lattice, where it is the worst.
    between = [(one[:-1, :-1] + one[:-1, 1:] + one[1:, :-1] + one[1:, 1:]) / 4.0 for one in (lat_deg, lon_deg)]
    found_m = FRAME.many_to_local_m(np.column_stack([one.ravel() for one in between]))
    cells = degrees["rows"] - 1
    east_m = -12_000.0 + 23_000.0 * (np.arange(cells) + 0.5) / cells
    north_m = 14_000.0 - 23_000.0 * (np.arange(cells) + 0.5) / cells
    wanted_m = np.stack(np.meshgrid(east_m, north_m), axis=-1).reshape(-1, 2)
    assert np.abs(found_m - wanted_m).max() < 0.15


def test_nothing_is_kept_where_nothing_is_known(tmp_path: Path) -> None:
    write_ground(tmp_path, GroundView((0.0, 0.0), (10.0, 10.0)), FRAME)
    assert list(tmp_path.iterdir()) == []
    assert read_ground_files(tmp_path) == {}


def test_a_picture_that_does_not_shrink_is_made_smaller() -> None:
    """Noise is the worst there is."""
    rng = np.random.default_rng(1)
    pixels = rng.integers(0, 256, (1500, 2000, 4), dtype=np.uint8)
    pixels[..., 3] = 255
    view = GroundView((0.0, 0.0), (2000.0, 1500.0), Background(pixels, (0.0, 0.0), (2000.0, 1500.0)))
    assert len(encode_ground(view, FRAME)[PHOTO]) <= PHOTO_BYTES


def _not_json(run: Path) -> None:
    (run / DOCUMENT).write_text("{", encoding="utf-8")


def _gone(run: Path) -> None:
    (run / RELIEF).unlink()


def _few_heights(run: Path) -> None:
    content = json.loads((run / DOCUMENT).read_text(encoding="utf-8"))
    content["relief"]["heights"]["metres"].pop()
    (run / DOCUMENT).write_text(json.dumps(content), encoding="utf-8")


def _another_file(run: Path) -> None:
    content = json.loads((run / DOCUMENT).read_text(encoding="utf-8"))
    (run / DOCUMENT).write_text(json.dumps({**content, "photo": "../../secret"}), encoding="utf-8")


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (_not_json, f"{DOCUMENT}: "),
        (_gone, f"{RELIEF}: cannot be read"),
        (_few_heights, f"{DOCUMENT}: relief.heights.metres: expected "),
        (_another_file, f"{DOCUMENT}: photo, relief.file: expected "),
    ],
)
def test_damage_is_reported_in_one_line(spoil: Callable[[Path], None], words: str, tmp_path: Path) -> None:
    write_ground(tmp_path, ground_about(PLACES_M, hills=Hills()), FRAME)
    spoil(tmp_path)
    with pytest.raises(LogError) as refusal:
        read_ground_files(tmp_path)
    assert str(refusal.value).startswith(f"{tmp_path}/{words}")
    assert "\n" not in str(refusal.value)
