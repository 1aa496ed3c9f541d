"""MAVFTP beyond the dialogues with the real autopilots: large files, packed parameters, lost answers."""

from __future__ import annotations

import pytest
from pymavlink.mavftp import MAVFTP

from simulator.config import AutopilotKind
from simulator.messages import FileOperation as Ftp
from simulator.messages import FileRequest, Outbound
from tests.simulator.harness import GCS, OTHER, Operator, fields_of


class Client:
    """Asks with one number after the other, as libraries do."""

    def __init__(self, kind: AutopilotKind) -> None:
        self.op = Operator(kind)
        self.op.run(5)
        self.number = 0

    def ask(
        self, operation: Ftp, data: bytes = b"", offset: int = 0, size: int = 0, sender: object = GCS
    ) -> list[bytes]:
        self.number += 1
        request = FileRequest(self.number, 0, operation, offset, data, size or len(data))
        return [bytes(fields_of(one)["payload"]) for one in self.op.send(request, sender)]  # type: ignore[arg-type]

    def put(self, name: bytes, data: bytes) -> None:
        self.ask(Ftp.CREATEFILE, name)
        for at in range(0, len(data), 239):
            self.ask(Ftp.WRITEFILE, data[at : at + 239], at)
        self.ask(Ftp.TERMINATESESSION)

    def get(self, name: bytes, size: int = 239) -> bytes:
        """Read a file in one burst, whose parts come with the steps of the simulation."""
        self.ask(Ftp.OPENFILERO, name)
        heard = self.ask(Ftp.BURSTREADFILE, size=size)
        before = len(self.op.log)
        self.op.run(30)
        heard += [bytes(fields_of(one)["payload"]) for _, one in self.op.log[before:] if is_file(one)]  # type: ignore[arg-type]
        parts = [(int.from_bytes(one[8:12], "little"), one[12 : 12 + one[4]]) for one in heard if one[3] == Ftp.ACK]
        assert heard[-1][3] == Ftp.NAK, "the end is told"
        self.number += len(heard)
        self.ask(Ftp.TERMINATESESSION)
        whole = bytearray(max(at + len(data) for at, data in parts))
        for at, data in parts:
            whole[at : at + len(data)] = data
        return bytes(whole)


def is_file(message: Outbound) -> bool:
    return message.name == "FILE_TRANSFER_PROTOCOL"


@pytest.mark.parametrize("kind", list(AutopilotKind))
def test_a_large_file_comes_back_in_a_burst(kind: AutopilotKind) -> None:
    client = Client(kind)
    data = bytes(at % 251 for at in range(20_000))
    client.put(b"/large.bin", data)
    assert client.get(b"/large.bin") == data


@pytest.mark.parametrize("block", [239, 110, 60])
@pytest.mark.parametrize("query", [b"", b"?withdefaults=1"])
def test_packed_parameters_are_what_pymavlink_reads(block: int, query: bytes) -> None:
    client = Client(AutopilotKind.ARDUPILOT)
    params = client.op.vehicle.params
    params["RTL_ALT"] = 4200.0
    read = MAVFTP.ftp_param_decode(client.get(b"@PARAM/param.pck" + query, block))
    assert {name.decode(): value for name, value, _ in read.params} == pytest.approx(
        {one: params[one] for one in params}
    )
    if query:
        assert [(name, value) for name, value, _ in read.defaults if name == b"RTL_ALT"] == [(b"RTL_ALT", 1500)]


def test_an_answer_that_was_lost_is_given_again_and_nothing_is_done_twice() -> None:
    client = Client(AutopilotKind.PX4)
    first = client.ask(Ftp.CREATEDIRECTORY, b"folder")
    client.number -= 1
    assert client.ask(Ftp.CREATEDIRECTORY, b"folder") == first
    assert client.ask(Ftp.CREATEDIRECTORY, b"folder")[0][3] == Ftp.NAK


def test_an_idle_file_is_closed() -> None:
    client = Client(AutopilotKind.PX4)
    client.put(b"note", b"a")
    client.ask(Ftp.OPENFILERO, b"note")
    assert client.ask(Ftp.OPENFILERO, b"note", sender=OTHER)[0][3] == Ftp.NAK
    client.op.run(11)
    assert client.ask(Ftp.OPENFILERO, b"note", sender=OTHER)[0][3] == Ftp.ACK


def test_px4_answers_with_its_own_session_and_ardupilot_with_the_stations() -> None:
    for kind, own in ((AutopilotKind.PX4, 0), (AutopilotKind.ARDUPILOT, 66)):
        client = Client(kind)
        client.put(b"/note.txt", b"a note")
        [opened] = client.op.send(FileRequest(900, 66, Ftp.OPENFILERO, 0, b"/note.txt", 9))
        assert (opened.fields["payload"][2], opened.fields["payload"][3]) == (own, Ftp.ACK)  # type: ignore[index]
        [refused] = client.op.send(FileRequest(901, 67, Ftp.OPENFILERO, 0, b"/none.txt", 9))
        assert (refused.fields["payload"][2], refused.fields["payload"][3]) == (67, Ftp.NAK)  # type: ignore[index]
