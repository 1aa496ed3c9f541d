"""MAVFTP of both autopilots: files in memory and the server, after GCS_FTP.cpp and mavlink_ftp.cpp.

One file can be open at a time. A file that a station writes exists until the simulation ends, as on a card.
"""

from __future__ import annotations

import itertools
import math
import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

from simulator.messages import FileOperation as Ftp
from simulator.messages import FileRequest, Outbound, Peer, build_message

REPLY = struct.Struct("<HBBBBBxI")
PAYLOAD_BYTES, DATA_BYTES = 251, 239
WORD = struct.Struct("<I")
CHUNKS_A_STEP = 5
"""Burst chunks per step, about as many as both autopilots send over a network."""
WRITES = frozenset({Ftp.OPENFILEWO, Ftp.CREATEFILE})
OPENS = WRITES | {Ftp.OPENFILERO}
BAD_FILE, NO_FOLDER, IS_FOLDER, NOT_EMPTY = 9, 20, 21, 39
"""errno."""


class Error(IntEnum):
    """MAVFTP's errors."""

    FAIL = 1
    FAIL_ERRNO = 2
    INVALID_DATA_SIZE = 3
    INVALID_SESSION = 4
    NO_SESSIONS = 5
    END_OF_FILE = 6
    UNKNOWN_COMMAND = 7
    EXISTS = 8
    PROTECTED = 9
    NOT_FOUND = 10


class FileRefusedError(Exception):
    """A request that is answered with an error."""

    def __init__(self, error: Error, errno: int | None = None) -> None:
        super().__init__(error.name)
        self.answer = bytes([error] if errno is None else [error, errno])


@dataclass(frozen=True, slots=True)
class VirtualFile:
    """A file generated when it is read, or parsed when it is closed."""

    size: int
    """Size reported before the content is known."""
    build: Callable[[int], bytes]
    """Build its content for a station with this read size."""
    put: Callable[[bytes], None] | None = None
    """Take written content; None if read-only."""


class FileTree:
    """Files and folders by path, without a leading slash."""

    def __init__(self) -> None:
        self._entries: dict[str, bytearray | None] = {}
        """Files and folders by path; None is a folder."""

    def file_at(self, path: str, *, create: bool = False) -> bytearray:
        """Return the content of a file, to read or to change.

        Raises:
            FileRefusedError: there is none, and none is to be created or can be.
        """
        if create and path not in self._entries:
            self._check_parent(path)
            self._entries[path] = bytearray()
        content = self._find(path)
        if content is None:
            raise FileRefusedError(Error.FAIL_ERRNO, IS_FOLDER)
        return content

    def list_folder(self, path: str) -> list[tuple[str, int | None]]:
        """Return names and sizes in a folder; the size of a folder is None."""
        if path and (path not in self._entries or self._entries[path] is not None):
            raise FileRefusedError(Error.NOT_FOUND)
        below = [(one.rpartition("/"), content) for one, content in sorted(self._entries.items())]
        return [(name, None if data is None else len(data)) for (folder, _, name), data in below if folder == path]

    def make_folder(self, path: str) -> None:
        """Make a folder in an existing one."""
        if not path or path in self._entries:
            raise FileRefusedError(Error.EXISTS)
        self._check_parent(path)
        self._entries[path] = None

    def remove(self, path: str, kinds: tuple[type, ...] = (bytearray, type(None))) -> None:
        """Remove a file, or an empty folder, if its kind may be removed."""
        if not isinstance(self._find(path), kinds):
            raise FileRefusedError(Error.FAIL_ERRNO, IS_FOLDER if bytearray in kinds else NO_FOLDER)
        if any(one.startswith(f"{path}/") for one in self._entries):
            # ArduPilot then tries it as a file.
            raise FileRefusedError(Error.FAIL_ERRNO, IS_FOLDER if bytearray in kinds else NOT_EMPTY)
        del self._entries[path]

    def rename(self, old: str, new: str) -> None:
        """Rename a file, or a folder with its contents."""
        self._find(old)
        self._check_parent(new)
        moved = [one for one in self._entries if one == old or one.startswith(f"{old}/")]
        self._entries |= {new + one.removeprefix(old): self._entries.pop(one) for one in moved}

    def _find(self, path: str) -> bytearray | None:
        if path not in self._entries:
            raise FileRefusedError(Error.NOT_FOUND)
        return self._entries[path]

    def _check_parent(self, path: str) -> None:
        parent = path.rpartition("/")[0]
        if parent and self._find(parent) is not None:
            raise FileRefusedError(Error.NOT_FOUND)


@dataclass(slots=True)
class OpenFile:
    """The open file."""

    writes: bool
    data: bytearray | None
    """Content; None until the first part of a virtual file is read."""
    size: int
    virtual: VirtualFile | None = None

    def read(self, offset: int, most: int) -> bytes:
        """Return a part of it."""
        if self.data is None:
            self.data = bytearray() if self.virtual is None else bytearray(self.virtual.build(most))
        return bytes(self.data[offset : offset + most])

    def write(self, offset: int, data: bytes) -> None:
        """Overwrite a part of it; a gap before the part is filled with zeros."""
        self.data = bytearray() if self.data is None else self.data
        self.data.extend(bytes(max(0, offset + len(data) - len(self.data))))
        self.data[offset : offset + len(data)] = data


@dataclass(slots=True)
class Reply:
    """Answer to a request without an error."""

    data: bytes = b""
    offset: int = 0
    burst: bool = False


class FileServer:
    """PX4's server, for one of its links."""

    SILENCE_S = 10.0
    """Silence after which the file is closed."""

    def __init__(self, tree: FileTree) -> None:
        self.tree = tree
        self.link = 0
        """Link of the last request."""
        self._open: OpenFile | None = None
        self._asked_s = float("-inf")
        self._last: tuple[object, Outbound] | None = None
        """Last answer, and the key that identifies a repeated request."""
        self._burst: Iterator[Outbound] = iter(())

    def handle(self, request: FileRequest, sender: Peer, now_s: float) -> list[Outbound]:
        """Return the answers to a request; a burst continues with each `take_burst`."""
        self.link = sender.link
        if self._last is not None and self._last[0] == self._mark(request, sender):
            self._asked_s = now_s
            return [self._last[1]]
        self._last = None
        try:
            reply = self._carry_out(request, now_s)
        except FileRefusedError as refused:
            answers = [self._answer(request, sender, Reply(refused.answer, self._offset_of(request)), Ftp.NAK)]
        else:
            answers = []
            if reply.burst:
                self._burst = self._iterate_burst(request, sender)
                answers += self.take_burst()
            else:
                answers.append(self._answer(request, sender, reply))
        self._asked_s = now_s
        return answers

    def take_burst(self) -> list[Outbound]:
        """Return the next few parts of a burst."""
        return list(itertools.islice(self._burst, CHUNKS_A_STEP))

    def tick(self, now_s: float) -> Sequence[Outbound]:
        """Return what to send now, and close a file that is no longer requested."""
        if self._open is None:
            return ()
        if now_s - self._asked_s > self.SILENCE_S:
            self._close()
        return self.take_burst()

    @property
    def _file(self) -> OpenFile:
        """The open file.

        Raises:
            FileRefusedError: there is none.
        """
        if self._open is None:
            raise FileRefusedError(Error.INVALID_SESSION)
        return self._open

    # Differences between the two servers.

    def _mark(self, request: FileRequest, sender: Peer) -> object:  # noqa: ARG002 - whoever repeats it
        return request.number

    def _offset_of(self, request: FileRequest) -> int:
        return request.offset

    def _session_of(self, request: FileRequest, opcode: Ftp) -> int:
        """Return the session of an answer: that of an opened file is 0, whatever was requested."""
        return 0 if opcode == Ftp.ACK and request.operation in OPENS else request.session

    def _carry_out(self, request: FileRequest, now_s: float) -> Reply:  # noqa: ARG002 - tick closes what was forgotten
        if request.operation in {Ftp.READFILE, Ftp.BURSTREADFILE, Ftp.WRITEFILE, Ftp.TERMINATESESSION} and (
            request.session != 0 or self._open is None
        ):
            raise FileRefusedError(Error.INVALID_SESSION)
        return Reply(self._dispatch(request), request.offset, burst=request.operation == Ftp.BURSTREADFILE)

    def _dispatch(self, request: FileRequest) -> bytes:
        match request.operation:
            case Ftp.NONE | Ftp.BURSTREADFILE:
                return b""
            case Ftp.TERMINATESESSION | Ftp.RESETSESSION:
                self._close()
                return b""
            case Ftp.OPENFILERO | Ftp.OPENFILEWO | Ftp.CREATEFILE:
                return self._open_file(request)
            case Ftp.READFILE:
                return self._read(request)
            case Ftp.WRITEFILE:
                return self._write(request)
            case Ftp.LISTDIRECTORY:
                return self._list(request)
            case Ftp.CALCFILECRC:
                # A checksum with nothing inverted before and after it.
                return WORD.pack(~zlib.crc32(self._content(self._path(request)), 0xFFFFFFFF) & 0xFFFFFFFF)
            case _:
                return self._change(request)

    def _change(self, request: FileRequest) -> bytes:
        match request.operation:
            case Ftp.CREATEDIRECTORY:
                self.tree.make_folder(self._path(request))
            case Ftp.REMOVEFILE:
                self.tree.remove(self._path(request), (bytearray,))
            case Ftp.REMOVEDIRECTORY:
                self.tree.remove(self._path(request), (type(None),))
            case Ftp.TRUNCATEFILE:
                data = self.tree.file_at(self._path(request))
                data[:] = data[: request.offset].ljust(request.offset, b"\0")
            case Ftp.RENAME:
                self.tree.rename(self._path(request), self._path(request, 1))
            case _:
                raise FileRefusedError(Error.UNKNOWN_COMMAND)
        return b""

    def _path(self, request: FileRequest, part: int = 0) -> str:
        names = request.data.split(b"\0")
        path = names[part].decode("utf-8", "replace") if part < len(names) else ""
        if ".." in path.split("/"):
            raise FileRefusedError(Error.PROTECTED)
        return path.strip("/")

    def _open_file(self, request: FileRequest) -> bytes:
        if self._open is not None:
            raise FileRefusedError(Error.NO_SESSIONS)
        writes = request.operation in WRITES
        data = self.tree.file_at(self._path(request), create=writes)
        self._open = OpenFile(writes, data, len(data))
        if request.operation == Ftp.CREATEFILE:
            data.clear()
        return WORD.pack(self._open.size)

    def _read(self, request: FileRequest) -> bytes:
        if request.offset >= self._file.size:
            raise FileRefusedError(Error.END_OF_FILE)
        if self._file.writes:
            raise FileRefusedError(Error.FAIL_ERRNO, BAD_FILE)
        return self._file.read(request.offset, request.size)

    def _write(self, request: FileRequest) -> bytes:
        if not self._file.writes:
            raise FileRefusedError(Error.FAIL_ERRNO, BAD_FILE)
        self._file.write(request.offset, request.data)
        return WORD.pack(len(request.data))

    def _list(self, request: FileRequest) -> bytes:
        """Return the names that fit; the folder itself and its parent become skip entries."""
        entries = ["S", "S", *map(_describe_entry, self.tree.list_folder(self._path(request)))]
        return _pack_entries(entries[request.offset :], b"\0")

    def _content(self, path: str) -> bytes:
        try:
            return bytes(self.tree.file_at(path))
        except FileRefusedError as refused:
            raise FileRefusedError(Error.FAIL_ERRNO, 0) from refused  # it gives no reason

    def _close(self) -> None:
        file, self._open, self._burst = self._open, None, iter(())
        if file is not None and file.writes and file.virtual is not None and file.virtual.put is not None:
            file.virtual.put(bytes(file.data or b""))

    def _iterate_burst(self, request: FileRequest, sender: Peer) -> Iterator[Outbound]:
        file, offset, number = self._file, request.offset, request.number
        while offset < file.size:
            data = file.read(offset, DATA_BYTES)
            yield self._answer(request, sender, Reply(data, offset), number=number)
            offset, number = offset + len(data), number + 1
        yield self._answer(request, sender, Reply(bytes([Error.END_OF_FILE]), offset), Ftp.NAK, number)

    def _answer(
        self, request: FileRequest, to: Peer, reply: Reply, opcode: Ftp = Ftp.ACK, number: int | None = None,
        *, ends: bool = False,
    ) -> Outbound:  # fmt: skip
        number = request.number if number is None else number
        head = REPLY.pack(
            (number + 1) & 0xFFFF,
            self._session_of(request, opcode),
            opcode,
            len(reply.data),
            request.operation,
            ends,
            reply.offset,
        )
        frame = build_message(
            "FILE_TRANSFER_PROTOCOL", target_network=0, target_system=to.sysid, target_component=to.compid,
            payload=list((head + reply.data).ljust(PAYLOAD_BYTES, b"\0")),
        )  # fmt: skip
        self._keep(request, to, number, reply, frame)
        return frame

    def _keep(self, request: FileRequest, to: Peer, number: int, reply: Reply, frame: Outbound) -> None:
        if len(reply.data) <= WORD.size:
            self._last = self._mark(replace(request, number=number), to), frame


class ArduPilotFileServer(FileServer):
    """ArduPilot's server, for all its links; the station chooses the session number."""

    SILENCE_S = math.inf
    SESSION_S = 3.0
    """Silence after which another station may take over."""
    SLOWS_S = 1.0
    """Time after an answer in which all streams are slower."""
    MOST_CHUNKS = 500

    def __init__(
        self, tree: FileTree, find_virtual: Callable[[str], VirtualFile | None], say: Callable[[str], None]
    ) -> None:
        super().__init__(tree)
        self._find_virtual, self._say = find_virtual, say
        self._session = -1

    def is_active(self, now_s: float) -> bool:
        """Return whether it is sending answers now."""
        return now_s - self._asked_s < self.SLOWS_S

    def handle(self, request: FileRequest, sender: Peer, now_s: float) -> list[Outbound]:
        """Return the answers to a request."""
        answers = super().handle(request, sender, now_s)
        if request.operation == Ftp.TERMINATESESSION:
            self._asked_s = -math.inf
        return answers

    def _mark(self, request: FileRequest, sender: Peer) -> object:
        return sender, request.session, request.number

    def _keep(self, request: FileRequest, to: Peer, number: int, reply: Reply, frame: Outbound) -> None:  # noqa: ARG002 - all of them
        self._last = self._mark(replace(request, number=number), to), frame

    def _offset_of(self, request: FileRequest) -> int:
        return request.offset if request.operation in {Ftp.LISTDIRECTORY, Ftp.READFILE, Ftp.WRITEFILE} else 0

    def _session_of(self, request: FileRequest, opcode: Ftp) -> int:  # noqa: ARG002 - the station's own
        return request.session

    def _carry_out(self, request: FileRequest, now_s: float) -> Reply:
        ends = request.operation in {Ftp.TERMINATESESSION, Ftp.RESETSESSION}
        idle = now_s - self._asked_s >= self.SESSION_S
        if request.session != self._session:
            if ends:
                return Reply()
            if self._open is not None and not idle:
                raise FileRefusedError(Error.INVALID_SESSION)
            self._close()
        if request.operation == Ftp.OPENFILERO and idle:
            self._close()
        if request.operation in {Ftp.READFILE, Ftp.BURSTREADFILE, Ftp.WRITEFILE}:
            if self._open is None:
                raise FileRefusedError(Error.NOT_FOUND)
            if self._open.writes is not (request.operation == Ftp.WRITEFILE):
                raise FileRefusedError(Error.FAIL)
        return Reply(self._dispatch(request), self._offset_of(request), burst=request.operation == Ftp.BURSTREADFILE)

    def _change(self, request: FileRequest) -> bytes:
        match request.operation:
            case Ftp.REMOVEFILE | Ftp.REMOVEDIRECTORY:
                self.tree.remove(self._path(request))
            case Ftp.CREATEDIRECTORY | Ftp.RENAME:
                return super()._change(request)
            case _:
                self._say(f"Unsupported FTP: {request.operation}")
                raise FileRefusedError(Error.FAIL)
        return b""

    def _path(self, request: FileRequest, part: int = 0) -> str:
        path = request.data.split(b"\0")[part].decode("utf-8", "replace")
        if not path:
            raise FileRefusedError(Error.INVALID_DATA_SIZE)
        return path.strip("/")

    def _open_file(self, request: FileRequest) -> bytes:
        if self._open is not None:
            raise FileRefusedError(Error.FAIL)
        path, writes = self._path(request), request.operation in WRITES
        if path.startswith("@"):
            virtual = self._find_virtual(path)
            if virtual is None or (writes and virtual.put is None):
                raise FileRefusedError(Error.NOT_FOUND)
            self._open = OpenFile(writes, bytearray() if writes else None, virtual.size, virtual)
        else:
            data = self.tree.file_at(path, create=request.operation == Ftp.CREATEFILE)
            self._open = OpenFile(writes, data, len(data))
            if request.operation == Ftp.CREATEFILE:
                data.clear()
        self._session = request.session
        return b"" if writes else WORD.pack(self._open.size)

    def _read(self, request: FileRequest) -> bytes:
        data = self._file.read(request.offset, min(request.size, DATA_BYTES))
        if not data:
            raise FileRefusedError(Error.END_OF_FILE)
        return data

    def _write(self, request: FileRequest) -> bytes:
        self._file.write(request.offset, request.data)
        return b""

    def _list(self, request: FileRequest) -> bytes:
        entries = ["D.", "D..", *map(_describe_entry, self.tree.list_folder(self._path(request)))]
        return _pack_entries(entries[request.offset :], b"\0\0")

    def _content(self, path: str) -> bytes:
        virtual = self._find_virtual(path) if path.startswith("@") else None
        return bytes(self.tree.file_at(path)) if virtual is None else virtual.build(DATA_BYTES)

    def _close(self) -> None:
        super()._close()
        self._session = -1

    def _iterate_burst(self, request: FileRequest, sender: Peer) -> Iterator[Outbound]:
        file, most, number, after = self._file, request.size or DATA_BYTES, request.number, 0
        for chunk in range(self.MOST_CHUNKS):
            offset = request.offset + chunk * most
            data = file.read(offset, most)
            if not data:
                yield self._answer(request, sender, Reply(bytes([Error.END_OF_FILE]), after), Ftp.NAK, number)
                return
            ends = len(data) < most or chunk == self.MOST_CHUNKS - 1
            yield self._answer(request, sender, Reply(data, offset), number=number, ends=ends)
            # After a whole part, the error that follows carries that part's offset.
            after, number = offset + (len(data) if len(data) < most else 0), number + 1


def _describe_entry(entry: tuple[str, int | None]) -> str:
    name, size = entry
    return f"D{name}" if size is None else f"F{name}\t{size}"


def _pack_entries(entries: Sequence[str], end: bytes) -> bytes:
    packed = b""
    for entry in entries:
        raw = entry.encode("utf-8") + end
        if len(packed) + len(raw) > DATA_BYTES:
            break
        packed += raw
    if not packed:
        raise FileRefusedError(Error.END_OF_FILE)
    return packed
