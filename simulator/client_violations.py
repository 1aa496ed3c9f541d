"""A client's violations of MAVLink's rules for missions, addresses and heartbeats.

Evaluated from the frames on the client's side of the link, so a client is not blamed for the link's losses and delays.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field

from simulator.messages import MissionResult
from simulator.transcript import Said

HEARTBEAT_GAP_S = 5.0
"""Longest gap between a client's HEARTBEATs, simulated; one a second is due."""
ANSWER_S = 1.0
"""Time after which an unanswered request counts as ignored."""
AGAIN_S = 0.1
"""Time after an item from which an unrequested resend is allowed, as the next request may be lost."""
SAME_NUMBER = 3
"""Consecutive frames with one sequence number that count as unnumbered."""


@dataclass(frozen=True, slots=True)
class Violation:
    """One violation by a client."""

    t_s: float
    vehicle: str
    client: int
    """MAVLink system id of the client."""
    about: str
    """``upload``, ``download``, ``heartbeat``, ``address`` or ``numbering``."""
    what: str

    def __str__(self) -> str:
        """Return it as one line."""
        return f"{self.t_s:9.2f} s  {self.vehicle}: client {self.client} {self.what}"


@dataclass(slots=True)
class _Upload:
    asked: Counter[int] = field(default_factory=Counter)
    sent: Counter[int] = field(default_factory=Counter)
    last: int = -1
    """Last requested item."""
    asked_s: dict[int, float] = field(default_factory=dict)
    """Time of the first request of each item."""
    sent_s: float = 0.0
    """Time of the last item."""
    over: bool = False
    """Whether it has ended; an item requested twice may arrive again after the end."""

    def end(self, now_s: float) -> Iterator[tuple[str, str]]:
        """Yield requested items that never came."""
        for seq, times in self.asked.items():
            if not self.over and not self.sent[seq] and now_s - self.asked_s[seq] >= ANSWER_S:
                yield "upload", f"never sends item {seq}, which was asked for {_count_times(times)}"
        self.over = True


@dataclass(slots=True)
class _Download:
    began_s: float
    count: int | None = None
    requested: set[int] = field(default_factory=set)
    next: int = 0

    def find_unrequested(self) -> Iterator[tuple[str, str]]:
        """Yield items of the list that were never requested."""
        if missing := sorted(set(range(self.count or 0)) - self.requested):
            items = f"item{'s' * (len(missing) > 1)} {', '.join(map(str, missing))}"
            yield "download", f"never asks for {items} of {self.count}"


class _Dialogue:
    """State of one client's dialogue with one vehicle."""

    def __init__(self, sysid: int, fleet: Collection[int]) -> None:
        self._sysid, self._fleet = sysid, fleet
        self._uploads: dict[int, _Upload] = {}
        self._downloads: dict[int, _Download] = {}
        self._beat_s: float | None = None
        self._number, self._same = -1, 0

    def judge(self, said: Said) -> Iterator[tuple[str, str]]:
        """Take the next message, and yield its violations."""
        if not said.up:
            yield from self._hear(said)
            return
        yield from self._judge_rhythm(said)
        if said.target not in {0, self._sysid}:
            if said.target not in self._fleet:
                yield "address", f"sends {said.name} to system {said.target}, which is not in the fleet"
            return
        kind = getattr(said.message, "mission_type", 0)
        match said.name:
            case "MISSION_COUNT":
                yield from self._end_upload(kind, said.t_s)
                self._uploads[kind] = _Upload()
            case "MISSION_ITEM" | "MISSION_ITEM_INT":
                yield from self._judge_item(said, kind)
            case "MISSION_REQUEST_LIST":
                yield from self._end_download(kind)
                self._downloads[kind] = _Download(said.t_s)
            case "MISSION_REQUEST" | "MISSION_REQUEST_INT":
                yield from self._judge_request(said.message.seq, kind)
            case "MISSION_ACK":
                yield from self._judge_acknowledgement(said, kind)

    def end(self, now_s: float) -> Iterator[tuple[str, str]]:
        """Yield what was left incomplete."""
        for kind in tuple(self._uploads):
            yield from self._end_upload(kind, now_s)
        for kind, download in tuple(self._downloads.items()):
            if now_s - download.began_s >= ANSWER_S:
                yield from self._end_download(kind)

    def _hear(self, said: Said) -> Iterator[tuple[str, str]]:
        kind = getattr(said.message, "mission_type", 0)
        upload, download = self._uploads.get(kind), self._downloads.get(kind)
        match said.name:
            case "MISSION_REQUEST" | "MISSION_REQUEST_INT" if upload is not None and not upload.over:
                upload.asked[said.message.seq] += 1
                upload.last = said.message.seq
                upload.asked_s.setdefault(upload.last, said.t_s)
            case "MISSION_ACK" if said.message.type != MissionResult.INVALID_SEQUENCE:
                yield from self._end_upload(kind, said.t_s)
                if said.message.type != MissionResult.ACCEPTED:
                    self._downloads.pop(kind, None)
            case "MISSION_COUNT" if download is not None:
                download.count = said.message.count

    def _judge_rhythm(self, said: Said) -> Iterator[tuple[str, str]]:
        number = said.message.get_seq()
        self._same = self._same + 1 if number == self._number else 1
        self._number = number
        if self._same == SAME_NUMBER:
            yield "numbering", f"does not number its frames: {SAME_NUMBER} in a row have the number {number}"
        since_s = said.t_s if self._beat_s is None else self._beat_s
        self._beat_s = said.t_s if said.name == "HEARTBEAT" else since_s
        if said.t_s - since_s > HEARTBEAT_GAP_S:
            yield "heartbeat", f"sends no HEARTBEAT for {said.t_s - since_s:.1f} s, from {since_s:.1f} s on"
            self._beat_s = said.t_s  # report once

    def _judge_item(self, said: Said, kind: int) -> Iterator[tuple[str, str]]:
        seq, upload = said.message.seq, self._uploads.get(kind)
        if upload is None:
            yield "upload", f"sends item {seq} while no upload is under way"
            return
        upload.sent[seq] += 1
        waited_s, upload.sent_s = said.t_s - upload.sent_s, said.t_s
        if not upload.asked[seq]:
            yield "upload", f"sends item {seq}, which was never asked for"
        elif upload.sent[seq] > upload.asked[seq] and (seq != upload.last or waited_s < AGAIN_S):
            asked, sent = _count_times(upload.asked[seq]), _count_times(upload.sent[seq])
            yield "upload", f"sends item {seq} {sent}, asked for it {asked}"

    def _judge_request(self, seq: int, kind: int) -> Iterator[tuple[str, str]]:
        download = self._downloads.get(kind)
        if download is None or download.count is None:
            yield "download", f"asks for item {seq} without knowing how many there are (MISSION_REQUEST_LIST)"
            return
        if seq >= download.count:
            yield "download", f"asks for item {seq} of {download.count}"
        elif seq not in {download.next, download.next - 1}:
            yield "download", f"asks for item {seq} out of order, item {download.next} is the next"
        download.requested.add(seq)
        download.next = seq + 1

    def _judge_acknowledgement(self, said: Said, kind: int) -> Iterator[tuple[str, str]]:
        gives_up = said.message.type != MissionResult.ACCEPTED
        download = self._downloads.pop(kind, None)
        if download is not None:
            if not gives_up:
                yield from download.find_unrequested()
            return
        upload = self._uploads.get(kind)
        under_way = upload is not None and not upload.over
        if gives_up and upload is not None:
            upload.over = True
        elif under_way:
            yield "upload", "acknowledges its own upload, which the vehicle does"
        elif not gives_up:
            yield (
                "download",
                "sends MISSION_ACK though no download is open: one was acknowledged already, or none began",
            )

    def _end_upload(self, kind: int, now_s: float) -> Iterator[tuple[str, str]]:
        if (upload := self._uploads.get(kind)) is not None:
            yield from upload.end(now_s)

    def _end_download(self, kind: int) -> Iterator[tuple[str, str]]:
        download = self._downloads.pop(kind, None)
        if download is None or not download.count:
            return
        missing = list(download.find_unrequested())
        yield from missing
        if not missing:
            yield "download", f"never acknowledges its download of {download.count} items"


def _count_times(times: int) -> str:
    return "once" if times == 1 else f"{times} times"


def find_violations(said: Sequence[Said], sysid: int, fleet: Collection[int], now_s: float) -> list[Violation]:
    """Return clients' violations towards one vehicle, in order of time.

    Args:
        said: Its dialogue, in order of time.
        sysid: Its own MAVLink system id.
        fleet: All system ids present.
        now_s: Time of the evaluation, simulated.
    """
    dialogues: dict[int, _Dialogue] = {}
    found = []
    for one in said:
        if one.client == 0:
            continue
        dialogue = dialogues.setdefault(one.client, _Dialogue(sysid, fleet))
        found += [Violation(one.t_s, one.vehicle, one.client, *wrong) for wrong in dialogue.judge(one)]
    for client, dialogue in dialogues.items():
        found += [Violation(now_s, said[0].vehicle, client, *wrong) for wrong in dialogue.end(now_s)]
    return found
