"""What is a span and what is a pole: the same in every format, and what is neither is said with its number."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from missions import Matter, Understood, understand
from tests.missions.readers import tagged
from tests.missions.readers.tagged import EXPORTS, TABLES, Extract, MapNode, MapWay

LEFT_OUT: dict[str, dict[str, str]] = {
    "cable": {"power": "cable"},
    "underground line": {"power": "line", "location": "underground"},
    "disused line": {"disused:power": "line"},
    "planned line": {"power": "construction", "construction": "line"},
    "removed line": {"demolished:power": "minor_line"},
    "line of a substation": {"power": "line", "line": "busbar"},
}
SPANS: list[dict[str, str]] = [
    {"power": "line"}, {"power": "minor_line"}, {"power": "line;cable"}, {"power": "line", "location": "overground"}
]  # fmt: skip
NAMES = st.text("AbŽďářüß-3 /", min_size=1, max_size=6).map(str.strip).filter(lambda name: any(map(str.isalpha, name)))


@st.composite
def extracts(draw: st.DrawFn) -> Extract:
    """Lines side by side with a tower at every bend, of any meaning; a generator over the first span."""
    nodes, ways = [], []
    kinds = draw(st.lists(st.sampled_from(list(LEFT_OUT)), max_size=4))
    tagsets = [*draw(st.lists(st.sampled_from(SPANS), min_size=1, max_size=3)), *(LEFT_OUT[kind] for kind in kinds)]
    names = draw(st.lists(NAMES, min_size=len(tagsets), max_size=len(tagsets), unique_by=str.lower))
    for row, (tags, name) in enumerate(zip(tagsets, names, strict=True)):
        own = []
        for column in range(draw(st.integers(2, 4))):
            number = 100 * (row + 1) + column
            heights = draw(st.sampled_from([{}, {"ele": "410.5", "height": "30 m"}]))
            bend_m = draw(st.sampled_from([0.0, 40.0]))
            pole = {"power": "tower", "ref": f"{name} {column}", **heights}
            own.append(MapNode(number, 200.0 * column, 300.0 * row + bend_m, pole))
        nodes += own
        ways.append(MapWay(10 + row, tuple(own), {**tags, "name": name}))
    first, second = ways[0].nodes[:2]
    middle = (first.east_m + second.east_m) / 2, (first.north_m + second.north_m) / 2
    return Extract((*nodes, MapNode(9999, *middle, {"power": "generator"})), tuple(ways))


def seen(understood: Understood) -> tuple[object, ...]:
    """Return all that a network is: spans by their poles' names, poles by place and height, names of lines."""
    network = understood.network
    names = [pylon.id for pylon in network.pylons]
    places = {
        pylon.id: (round(pylon.lat_deg, 6), round(pylon.lon_deg, 6), pylon.elevation_m, pylon.height_m)
        for pylon in network.pylons
    }
    spans = sorted((names[segment.a], names[segment.b], segment.label) for segment in network.segments)
    return spans, places, sorted(set(understood.lines.values()))


def left(understood: Understood) -> dict[str, int]:
    """Return how many of each kind were left out."""
    words = ", ".join(one.text for one in understood.found if one.matter is Matter.LEFT_OUT)
    return {what: int(count) for count, what in re.findall(r"(\d+) ([a-z ]+?)s? \(", words)}


@settings(max_examples=12, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(extract=extracts())
def test_a_map_means_the_same_in_every_format(extract: Extract) -> None:
    expected, kinds = None, {}
    for name, (write, wanted) in EXPORTS.items():
        with tempfile.TemporaryDirectory() as folder:
            understood = understand(write(extract, Path(folder)), wanted, anywhere=True)
        expected = expected or seen(understood)
        assert seen(understood) == expected, name
        counts = {what: count for what, count in left(understood).items() if what != "generator"}
        kinds = kinds or counts
        assert counts == kinds, name
    spans, *_ = expected or ([],)
    flown = [way for way in extract.ways if not any(tags.items() <= way.tags.items() for tags in LEFT_OUT.values())]
    assert len(spans) == sum(len(way.nodes) - 1 for way in flown)
    assert sum(kinds.values()) == len(extract.ways) - len(flown)


@settings(max_examples=12, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(extract=extracts())
def test_a_table_means_the_same_with_the_tags_of_a_line_at_its_poles(extract: Extract) -> None:
    found = []
    for write in TABLES.values():
        with tempfile.TemporaryDirectory() as folder:
            found.append(seen(understand(write(extract, Path(folder)), anywhere=True)))
    with tempfile.TemporaryDirectory() as folder:
        spans, _, lines = seen(understand(tagged.overpass(extract, Path(folder)), anywhere=True))
    assert found[0] == found[1]
    assert (found[0][0], found[0][2]) == (spans, lines)
