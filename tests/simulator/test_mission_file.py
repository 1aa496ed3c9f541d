"""The simulated ArduPilot takes the last part of a mission as a file, as the real one was measured to."""

from __future__ import annotations

from executor.adapters.mavlink.codec import MavlinkCodec
from executor.core.interface.messages import FileReply, FileRequest, MissionItemInt
from executor.protocols.machine import Accepted
from executor.protocols.mission_file import SESSION, FileOperation, MissionFileUpload
from missions.items import MissionItem
from simulator.config import AutopilotKind
from simulator.messages import Peer
from simulator.mission_store import UploadFault
from simulator.wire import Codec
from tests.simulator.harness import GCS, Operator, land, numbered, takeoff, waypoint

OLD = numbered((waypoint(0, 0, 0.0), takeoff(), waypoint(60, 0), waypoint(120, 0), land()))
NEW = numbered((*OLD[:3], waypoint(120, 0), waypoint(180, 5, 20.31), waypoint(240, 0), land()))
WRITTEN = FileRequest(SESSION, FileOperation.WRITE, 10, b"x" * 38)
CLOSED = FileRequest(SESSION, FileOperation.CLOSE)


class Station:
    """Ours, with the frames of both sides as they are on the wire."""

    def __init__(self, op: Operator) -> None:
        self.op = op
        self.codec = MavlinkCodec()
        self.theirs = Codec(1)
        self.number = 0

    def ask(self, request: object, sender: Peer = GCS) -> list[object]:
        [heard] = self.theirs.decode(self.codec.encode(request, 1, 1))  # type: ignore[arg-type]
        answers = self.op.send(heard.body, sender)
        frames = [one for answer in answers for one in self.codec.decode(self.theirs.encode(answer))]
        return [one.message for one in frames if isinstance(one.message, FileReply | MissionItemInt)]

    def say(self, request: FileRequest, sender: Peer = GCS) -> int | None:
        """Ask with a number of its own; return the error."""
        self.number += 1
        [answer] = self.ask(
            FileRequest(request.session, request.operation, request.offset, request.data, self.number), sender
        )
        assert isinstance(answer, FileReply)
        return answer.error

    def upload(self, items: tuple[MissionItem, ...], first: int) -> MissionFileUpload:
        upload, sent = MissionFileUpload(items, first, 100).begin(0.0)
        while upload.outcome is None and sent:
            heard, sent = [one for request in sent for one in self.ask(request)], ()
            for one in heard:
                upload, more = upload.on_message(one, 0.0)  # type: ignore[arg-type]
                sent += more
        return upload


def flying() -> tuple[Operator, Station]:
    op = Operator(AutopilotKind.ARDUPILOT)
    op.fly(OLD)
    op.run_until(lambda: op.vehicle.mission.index == 2)
    op.run(2)
    return op, Station(op)


def test_the_new_part_is_on_board_at_once_and_proven() -> None:
    op, station = flying()
    upload = station.upload(NEW, 3)
    assert (upload.outcome, upload.is_proven) == (Accepted(), True)
    assert [item.x for item in op.vehicle.store.items[1:]] == [item.x for item in NEW[1:]]
    assert op.texts().count("Auto mission changed, restarted command") == 1, "and not once for each item"
    op.run_until(lambda: op.vehicle.mission.index == 5)


def test_what_stands_behind_the_part_stays() -> None:
    op, station = flying()
    upload = station.upload(OLD[:4], 3)
    assert upload.outcome == Accepted()
    assert not upload.is_proven, "there is one item more on board"
    assert len(op.vehicle.store.items) == len(OLD)


def test_a_file_without_its_header_changes_nothing() -> None:
    op, station = flying()
    before = op.vehicle.store.items
    assert station.say(FileRequest(SESSION, FileOperation.OPEN_TO_WRITE, 0, b"@MISSION/mission.dat")) is None
    assert station.say(WRITTEN) is None
    assert station.say(CLOSED) is None
    assert op.vehicle.store.items == before
    assert station.say(WRITTEN) == 10, "no file is open"


def test_one_station_at_a_time() -> None:
    _, station = flying()
    opened = FileRequest(SESSION, FileOperation.OPEN_TO_WRITE, 0, b"@MISSION/mission.dat")
    other = FileRequest(3, FileOperation.OPEN_TO_WRITE, 0, b"@MISSION/mission.dat")
    assert station.say(opened) is None
    assert station.say(other) == 4
    assert station.say(opened) == 1, "it is open already"
    station.op.run(4)
    assert station.say(other) is None, "ours has said nothing for three seconds"


def test_other_files_and_vehicles_that_take_no_upload() -> None:
    op, station = flying()
    assert station.say(FileRequest(SESSION, FileOperation.OPEN_TO_WRITE, 0, b"@PARAM/param.pck")) == 10
    op.vehicle.store.fault = UploadFault.HALF
    assert not station.upload(NEW, 3).is_open


def test_streams_are_slower_while_it_answers() -> None:
    op, station = flying()
    assert op.vehicle._slow_down(1.0) == 1.0
    station.say(FileRequest(SESSION, FileOperation.OPEN_TO_WRITE, 0, b"@MISSION/mission.dat"))
    assert op.vehicle._slow_down(1.0) == 4.0
    station.say(CLOSED)
    assert op.vehicle._slow_down(1.0) == 1.0
