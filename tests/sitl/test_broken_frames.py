"""What a report that stock firmware of a radio puts inside a frame costs a real autopilot."""

from __future__ import annotations

import socket
import time
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mav

from tests.sitl.real import BOTH, Autopilot, Wanted, running
from tests.sitl.test_transfers import SETUP, STANDBY

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(240)]

ANSWER_REAL_S = 1.0
PATIENCE_S = 60.0
PLACES = range(1, 28)
"""Behind which byte of the broken frame, which has 28."""


@BOTH
def test_a_report_inside_a_frame_costs_that_frame_alone(autopilot: Autopilot, tmp_path: Path) -> None:
    """The emulated radio cuts what comes out of it so (`measure_frame`): 278 bytes are not taken for one frame."""
    if autopilot.binary is None:
        pytest.skip(f"{autopilot.variable}: expected the path of a real {autopilot.name}")
    pads = {pad.vehicle: pad for pad in SETUP.pads}
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station,
        running(autopilot, Path(autopilot.binary), tmp_path / "work", Wanted(pads, SETUP.frame, 1.0, {}, frozenset())),
    ):
        station.bind(("127.0.0.1", autopilot.port))
        station.settimeout(0.1)
        asker = _Asker(station)
        answered = [place for place in PLACES if asker.ask_behind_a_broken_frame(place)]
        print(f"{autopilot.name}: not answered behind a frame broken at {sorted({*PLACES} - {*answered})}")
        assert answered == list(PLACES)


class _Asker:
    """Asks for the time."""

    def __init__(self, station: socket.socket) -> None:
        """Wait until the autopilot has started."""
        self._station, self._from = station, ("", 0)
        self._mav, self._radio = mav.MAVLink(None, 255, 190), mav.MAVLink(None, 51, 68)
        until_s = time.monotonic() + PATIENCE_S
        while not any(one.get_type() == "HEARTBEAT" and one.system_status >= STANDBY for one in self._hear()):
            assert time.monotonic() < until_s

    def ask_behind_a_broken_frame(self, place: int) -> bool:
        """Return whether a question is answered that comes right behind a frame with a report inside."""
        number, status = 1_000_000 + place, mav.MAVLink_radio_status_message(200, 200, 90, 50, 50, 0, 0)
        question = mav.MAVLink_timesync_message(0, -number).pack(self._mav)
        broken = question[:place] + status.pack(self._radio) + question[place:]
        whole = mav.MAVLink_timesync_message(0, number).pack(self._mav)
        self._station.sendto(broken + whole, self._from)
        until_s = time.monotonic() + ANSWER_REAL_S
        while time.monotonic() < until_s:
            if any(one.get_type() == "TIMESYNC" and one.tc1 and one.ts1 == number for one in self._hear()):
                return True
        return False

    def _hear(self) -> list[Any]:
        parser = mav.MAVLink(None)
        parser.robust_parsing = True
        try:
            data, self._from = self._station.recvfrom(65536)
        except TimeoutError:
            return []
        return parser.parse_buffer(data) or []
