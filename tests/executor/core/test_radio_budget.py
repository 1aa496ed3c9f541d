"""Which streams are thinned for a radio, and the lines for the crew."""

from __future__ import annotations

from itertools import pairwise

import pytest
from pymavlink.dialects.v20 import common as mav

from executor.adapters.mavlink import message_readers
from executor.core.interface.codes import Severity
from executor.core.interface.messages import Radio
from executor.core.radio_budget import (
    FRAME_BYTES,
    GLOBAL_POSITION_INT,
    OWN_FACTORS,
    STREAMS_HZ,
    STREAMS_SHARE,
    THINNED_HZ,
    LinkMeasures,
    RadioShare,
    check_radio,
    list_streams_hz,
)
from missions import ARDUPILOT, PX4, Dialect

DIALECTS = pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=lambda dialect: str(dialect.name))
REPORTED = LinkMeasures(Radio(200, 200, 50, 50, 90), 0.42, 0.031)


@DIALECTS
def test_every_stream_has_a_size_and_every_step_asks_for_less(dialect: Dialect) -> None:
    steps = [list_streams_hz(dialect, step) for step in range(len(OWN_FACTORS))]
    assert steps[0].keys() <= FRAME_BYTES.keys()
    assert len(THINNED_HZ) == len(OWN_FACTORS) - 1
    for more, less in pairwise(steps):
        assert more.keys() == less.keys(), "nothing is given up altogether"
        assert all(less[message] <= more[message] for message in more)
    sums = [RadioShare(3).sum_bytes_s(dialect, step) for step in range(len(OWN_FACTORS))]
    assert sums == sorted(sums, reverse=True)
    assert steps[1][GLOBAL_POSITION_INT] == STREAMS_HZ[GLOBAL_POSITION_INT], "positions come last"
    assert steps[-1][GLOBAL_POSITION_INT] >= 1.0, "a segment is proven by them"
    seldom = {message for message, hz in steps[-1].items() if hz < 0.5}
    assert seldom <= dialect.own_streams_hz.keys(), "one report of a tilt, a fix or a switch decides nothing"


@DIALECTS
def test_without_a_radio_nothing_is_thinned(dialect: Dialect) -> None:
    share = RadioShare(vehicles=20)
    assert share.choose_streams_hz(dialect, on_radio=False) == list_streams_hz(dialect)
    assert check_radio(share, dialect, (LinkMeasures(), LinkMeasures())) == []


@DIALECTS
@pytest.mark.parametrize("vehicles", [1, 2, 3])
def test_streams_are_thinned_until_they_fit_and_no_further(dialect: Dialect, vehicles: int) -> None:
    share = RadioShare(vehicles)
    step = share.choose_step(dialect, on_radio=True)
    most_bytes_s = STREAMS_SHARE * 1200.0
    assert share.sum_bytes_s(dialect, step) <= most_bytes_s
    assert step == 0 or share.sum_bytes_s(dialect, step - 1) > most_bytes_s
    assert share.choose_step(dialect, on_radio=True) <= RadioShare(vehicles + 1).choose_step(dialect, on_radio=True)


def test_signatures_count_and_what_the_site_says_counts_more_than_a_guess() -> None:
    plain, signed = RadioShare(2), RadioShare(2, signed=True)
    frames_s = 2 * (sum(list_streams_hz(PX4).values()) + 2)
    assert signed.sum_bytes_s(PX4, 0) - plain.sum_bytes_s(PX4, 0) == pytest.approx(13 * frames_s)
    assert RadioShare(4, bytes_s=10_000.0).choose_step(PX4, on_radio=True) == 0
    assert RadioShare(1, bytes_s=300.0).choose_step(PX4, on_radio=False) > 0
    assert RadioShare(1, bytes_s=500.0).choose_step(PX4, on_radio=False) < RadioShare(
        1, bytes_s=500.0, others_bytes_s=100.0
    ).choose_step(PX4, on_radio=False), "other stations' share is not for streams"
    assert RadioShare(others_bytes_s=None).find_others_bytes_s(1200.0) == 120.0
    assert RadioShare(4, is_radio=True).choose_step(PX4, on_radio=False) > 0, "a serial port is one, unsaid"


def test_the_checklist_says_what_is_asked_of_what_it_carries() -> None:
    [check] = check_radio(RadioShare(4, bytes_s=5000.0), ARDUPILOT, (REPORTED, LinkMeasures()))
    assert (check.severity, check.text) == (Severity.OK, "2.6 of 5.0 kB/s, round trip 0.4 s, 3 % lost")
    [check] = check_radio(RadioShare(3), ARDUPILOT, (REPORTED,))
    assert check.severity is Severity.OK
    assert check.text.endswith("; streams are thinned, positions at 1 Hz")


def test_what_does_not_fit_is_reported_with_how_many_would() -> None:
    [check] = check_radio(RadioShare(6), ARDUPILOT, (REPORTED,))
    assert check.severity is Severity.WARNING
    assert check.text.endswith(": too slow for 6 vehicles, it carries 3")
    assert RadioShare(3).sum_bytes_s(ARDUPILOT, 3) <= STREAMS_SHARE * 1200.0


def test_what_is_sent_unasked_is_switched_off_where_there_is_no_room_for_it() -> None:
    wide = RadioShare(1, bytes_s=4000.0)
    assert wide.list_unwanted(PX4, on_radio=False) == ()
    assert RadioShare(4, bytes_s=4000.0).list_unwanted(PX4, on_radio=False) == tuple(PX4.unasked_hz)
    assert RadioShare(1).list_unwanted(PX4, on_radio=False) == (), "there is no radio"
    assert RadioShare(1).list_unwanted(PX4, on_radio=True) == tuple(PX4.unasked_hz)
    assert RadioShare(9).list_unwanted(ARDUPILOT, on_radio=True) == ()


def test_what_is_read_here_is_never_switched_off() -> None:
    names = {getattr(mav.mavlink_map.get(number), "msgname", "") for number in PX4.unasked_hz}
    assert not names & set(message_readers.READERS)
    assert set(PX4.unasked_hz) <= set(FRAME_BYTES)
    assert next(iter(PX4.unasked_hz)) == 74, "VFR_HUD is what is looked at"
