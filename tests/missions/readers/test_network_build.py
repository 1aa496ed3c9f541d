"""From what is drawn to spans: what is joined, split, divided and left out, each with the name of the line or pole."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from missions import LocalFrame, MendingLimits, RemarkTopic
from missions.readers.network_build import UnplacedNetwork, build_unplaced_network
from missions.readers.raw_network import Line, Pole, RawNetwork, ReadOptions, parse_where

FRAME = LocalFrame(49.6, 15.6)
Spot = tuple[float, float]


def pole(name: str, east_m: float, north_m: float, line: str = "", height_m: float | None = None) -> Pole:
    return Pole(f"point {name}", name, *FRAME.to_wgs84_deg(east_m, north_m), height_m=height_m, line=line)


def line(name: str, *places_m: Spot) -> Line:
    return Line(f"line {name}", name, (tuple((*FRAME.to_wgs84_deg(*place), None) for place in places_m),))


def built(*drawn: Pole | Line, mending: MendingLimits | None = None) -> UnplacedNetwork:
    drawing = RawNetwork("file", "test")
    drawing.poles += [one for one in drawn if isinstance(one, Pole)]
    for one in drawn:
        if isinstance(one, Line):
            drawing.add_line(one)
    return build_unplaced_network(drawing, mending or MendingLimits())


def spans(found: UnplacedNetwork) -> list[tuple[str, str, str]]:
    names = [pylon.id for pylon in found.pylons]
    return [(segment.label, names[segment.a], names[segment.b]) for segment in found.segments]


def said(found: UnplacedNetwork, matter: RemarkTopic) -> list[str]:
    return [finding.words for finding in found.found if finding.matter is matter]


def matters(found: UnplacedNetwork) -> Sequence[RemarkTopic]:
    return [finding.matter for finding in found.found]


def test_a_line_becomes_spans_at_the_poles_that_it_passes() -> None:
    found = built(pole("A", 0, 0), pole("B", 200, 0.2), pole("C", 400, 0), line("V1", (0, 0), (400, 0)))
    assert spans(found) == [("V1.1", "A", "B"), ("V1.2", "B", "C")]
    assert said(found, RemarkTopic.SPLIT) == ["V1: split at 1 on its way: B"]


def test_positions_on_the_straight_between_poles_are_no_poles() -> None:
    found = built(pole("A", 0, 0), pole("B", 200, 0), line("V1", (0, 0), (50, 0.3), (100, -0.4), (200, 0)))
    assert spans(found) == [("V1.1", "A", "B")]
    assert said(found, RemarkTopic.LEFT_OUT) == [
        "V1: 2 positions on the straight between poles: no poles are made there"
    ]


def test_a_bend_without_a_pole_gets_one() -> None:
    found = built(pole("A", 0, 0), pole("B", 200, 0), line("V1", (0, 0), (100, 30), (200, 0)))
    assert spans(found) == [("V1.1", "A", "P3"), ("V1.2", "P3", "B")]
    (words,) = said(found, RemarkTopic.MADE)
    assert words.startswith("V1: bends or meets another at 49.6")
    assert words.endswith("without a pole of the file: 'P3' is made there")


def test_ends_that_almost_meet_are_joined_as_far_as_asked() -> None:
    drawn = line("V1", (0, 0), (100, 0)), line("V2", (103, 0), (200, 0))
    apart = built(*drawn)
    assert spans(apart) == [("V1.1", "P1", "P2"), ("V2.1", "P3", "P4")]
    assert said(apart, RemarkTopic.NEARLY) == [
        "V1.1: 'P2' ends 3.0 m from 'P3' of V2.1 and does not meet it; snap_m = 3.1 joins them"
    ]
    joined = built(*drawn, mending=MendingLimits(snap_m=3.1))
    assert spans(joined) == [("V1.1", "P1", "P2"), ("V2.1", "P2", "P3")]
    assert said(joined, RemarkTopic.SNAPPED) == ["V2: joined to 'P2', 3.00 m away"]
    assert matters(joined) == [RemarkTopic.SNAPPED]


def test_a_line_that_ends_on_another_meets_it() -> None:
    found = built(line("V1", (0, 0), (200, 0)), line("V2", (100, 0.3), (100, 90)))
    assert [pair[1:] for pair in spans(found)] == [("P1", "P3"), ("P3", "P2"), ("P3", "P4")]
    assert said(found, RemarkTopic.SPLIT) == ["V1: split at 1 on its way: P3"]


def test_two_circuits_on_the_same_towers_are_inspected_once() -> None:
    towers = pole("A", 0, 0), pole("B", 200, 0), pole("C", 400, 50)
    found = built(*towers, line("V1", (0, 0), (200, 0), (400, 50)), line("V2", (400, 50), (200, 0), (0, 0)))
    assert [pair[1:] for pair in spans(found)] == [("A", "B"), ("B", "C")]
    assert said(found, RemarkTopic.DUPLICATE) == [
        "V2.1: runs over the same poles as V1.2: inspected once",
        "V2.2: runs over the same poles as V1.1: inspected once",
    ]


def test_lines_that_cross_without_a_pole_do_not_meet_and_it_is_reported() -> None:
    found = built(line("V1", (0, 0), (200, 0)), line("V2", (100, -80), (100, 80)))
    assert len(found.segments) == 2
    (words,) = said(found, RemarkTopic.CROSSING)
    assert words.startswith("V1.1: crosses V2.1 at 49.600000, 15.6013")


def test_a_position_drawn_twice_is_taken_once() -> None:
    found = built(line("V1", (0, 0), (100, 0), (100.01, 0), (200, 0)))
    assert spans(found) == [("V1.1", "P1", "P2"), ("V1.2", "P2", "P3")]
    assert said(found, RemarkTopic.ZERO) == ["V1: two positions at one place (49.600000, 15.601383): taken once"]


def test_a_line_of_no_length_is_left_out() -> None:
    found = built(line("V1", (0, 0), (0.1, 0)), line("V2", (50, 0), (200, 0)))
    assert [label for label, _, _ in spans(found)] == ["V2.1"]
    assert said(found, RemarkTopic.ZERO)[-1] == "V1: a part without length: left out"


def test_long_spans_are_divided_without_poles() -> None:
    found = built(line("V1", (0, 0), (1000, 0), (1100, 0)), mending=MendingLimits(max_span_m=300.0))
    assert len(found.segments) == 5
    assert said(found, RemarkTopic.CUT) == ["V1: 1000 m without a pole: divided into 4 spans of 250 m"]


def test_with_poles_a_long_span_is_only_said() -> None:
    drawn = pole("A", 0, 0), pole("B", 1000, 0), line("V1", (0, 0), (1000, 0))
    found = built(*drawn, mending=MendingLimits(max_span_m=300.0))
    assert spans(found) == [("V1.1", "A", "B")]
    assert said(found, RemarkTopic.LONG)[0].startswith("V1.1: 1000 m long: is a pole missing?")


def test_poles_beside_all_lines_are_left_out_with_how_far_they_are() -> None:
    drawn = pole("A", 0, 0), pole("B", 200, 0), pole("C", 100, 3), pole("D", 100, 900), line("V1", (0, 0), (200, 0))
    found = built(*drawn)
    assert [pylon.id for pylon in found.pylons] == ["A", "B"]
    assert said(found, RemarkTopic.UNUSED) == [
        "C: on no line: left out; V1.1 is 3.0 m away, snap_m = 3.1 takes it", "D: on no line: left out"
    ]  # fmt: skip
    assert [pair[1:] for pair in spans(built(*drawn, mending=MendingLimits(snap_m=3.1)))] == [("A", "C"), ("C", "B")]


def test_poles_of_one_name_are_distinguished_by_their_lines() -> None:
    found = built(
        pole("1", 0, 0, "V1"), pole("2", 200, 0, "V1"), pole("1", 0, 300, "V2"), pole("2", 200, 300, "V2"),
        line("V1", (0, 0), (200, 0)), line("V2", (0, 300), (200, 300)),
    )  # fmt: skip
    assert spans(found) == [("V1.1", "1", "2"), ("V2.1", "V2 1", "V2 2")]
    assert said(found, RemarkTopic.SAME_NAME)[0] == "1: another pole has this name: it is called 'V2 1' here"


def test_two_poles_at_one_place_are_one_which_knows_what_either_knew() -> None:
    found = built(pole("A", 0, 0), pole("A'", 0.2, 0, height_m=30.0), pole("B", 99, 0), line("V1", (0, 0), (99, 0)))
    assert [(pylon.id, pylon.height_m) for pylon in found.pylons] == [("A", 30.0), ("B", None)]
    assert said(found, RemarkTopic.SAME_PLACE) == ["A': 0.20 m from 'A': taken for the same pole"]


def test_parts_of_a_line_share_its_name_and_its_numbers() -> None:
    first, second = line("V1", (0, 0), (100, 0)), line("V1", (300, 0), (400, 0))
    found = built(Line("line V1", "V1", first.parts + second.parts))
    assert [label for label, _, _ in spans(found)] == ["V1.1", "V1.2"]
    assert set(found.lines.values()) == {"V1"}


def test_a_track_of_a_receiver_is_not_taken_for_poles_without_a_word() -> None:
    found = built(line("walk", *((float(2 * step), 0.0) for step in range(30))))
    assert said(found, RemarkTopic.SHORT) == ["walk: half of its spans are shorter than 2.0 m: are these poles?"]


@pytest.mark.parametrize(
    ("where", "attributes", "takes"),
    [
        ("voltage >= 110000", {"voltage": "110000"}, True),
        ("voltage >= 110000", {"Voltage": 22000}, False),
        ("voltage = 22000", {"voltage": "110000;22000"}, True),
        ("voltage != 22000", {"voltage": "110000;22000"}, False),
        ("voltage > 1", {"voltage": "high"}, False),
        ("voltage > 1", {"voltage": None}, False),
        ("operator = 'ČEPS, a.s.'", {"operator": "ČEPS, a.s."}, True),
        ('"line name" == V1 and kv<400', {"line name": "V1", "kv": 110.0}, True),
        ("band=land and x=1", {"band": "land", "x": "1.0"}, True),
        ("x=1 AND y=2", {"x": 1, "y": 3}, False),
    ],
)
def test_a_filter_compares_as_numbers_where_both_are(where: str, attributes: dict[str, object], takes: bool) -> None:
    assert ReadOptions("a.json", where=parse_where(where)).is_wanted(attributes) is takes


@pytest.mark.parametrize("where", ["", "voltage", "= 3", "a = 1 or b = 2", "a = 1 and", "a = 1 b = 2", "a ~ 3"])
def test_what_is_no_filter_is_refused(where: str) -> None:
    with pytest.raises(ValueError, match="expected comparisons such as"):
        parse_where(where)
