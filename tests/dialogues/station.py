"""A ground station that goes through a dialogue and writes down what is answered, in a form that can be compared."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from missions import PX4, Dialect, MissionItem
from simulator.transcript import describe_answer, name_mission_result
from tests.dialogues import words
from tests.dialogues.acts import Act, Chapter, Download, Look, Say, Until, Upload, What
from tests.dialogues.answer import Answer, Heard, extension, fold
from tests.dialogues.script import labels
from tests.dialogues.wires import Wire

GROUND_STATION, OTHER_STATION, COMPONENT = 255, 254, 190
BEAT_S = 0.4
FRESH_S = 1.6
"""Slow reports come at 1 Hz."""
STATION_PATIENCE_S = 3.0
ATTITUDE, POSITION, CURRENT, EXTENDED = 30, 33, 42, 245
KEPT = {
    "ATTITUDE",
    "GLOBAL_POSITION_INT",
    "MISSION_CURRENT",
    "EXTENDED_SYS_STATE",
    "HEARTBEAT",
    "SYS_STATUS",
    "STATUSTEXT",
    "MISSION_ITEM_REACHED",
}
STREAMS_HZ = {ATTITUDE: 25, POSITION: 5, CURRENT: 2, EXTENDED: 4}
READY_BIT, PLACED = 0x10000000, 16
FLIES_M_S, STANDS_M_S = 0.8, 0.3
IN_AIR = 2


class Station:
    """The dialogue's ground station."""

    def __init__(self, wire: Wire, dialect: Dialect) -> None:
        self._wire, self._dialect = wire, dialect
        self._me = mavlink.MAVLink(None, srcSystem=GROUND_STATION, srcComponent=COMPONENT)
        self._other = mavlink.MAVLink(None, srcSystem=OTHER_STATION, srcComponent=COMPONENT)
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self._beat_s = -math.inf
        self._last: dict[str, tuple[float, Any]] = {}
        self._heard: list[Heard] = []
        self._texts: list[str] = []
        self._inbox: list[Any] = []
        self._active_s = 0.0
        self._muted = False
        self._asked_parameter = ""
        self._missions: dict[int, str] = {0: "none"}
        self._uploading = ""
        self._labels = labels()
        self._narrated: list[str] = []
        self._reports: list[str] = []
        self._reached = -1

    # The dialogue.

    def hold(self, chapter: Chapter) -> dict[str, Answer]:
        """Go through a chapter and return the answer to each of its steps."""
        self._meet()
        answers = {}
        for step in chapter.steps:
            self._heard, self._texts, self._narrated, self._reports, state = [], [], [], [], ""
            for act in step.acts:
                state = self._act(act) or state
            answers[step.name] = Answer(
                (*fold(self._heard), *self._narrated, *self._reports), words.texts(self._texts), state
            )
        return answers

    def _meet(self) -> None:
        """Wait for the first heartbeat, and ask for what the answers are read from."""
        self._until(lambda: "HEARTBEAT" in self._last, 90.0, "heard")
        for number, hz in STREAMS_HZ.items():
            self._say_command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e6 / hz)
        self._run(0.4)
        # What nobody looks at only fills the socket of a station that is late.
        for name, (_, message) in self._last.items():
            if name not in KEPT and describe_answer(message) is None:
                self._say_command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message.get_msgId(), -1)
        self._run(0.4)

    def _act(self, act: Act) -> str:
        match act:
            case Say():
                self._say(act)
                self._run(act.listen_s)
            case Upload():
                self._upload(act)
            case Download():
                self._narrated += self._download(floats=act.floats, compare=act.compare)
            case Until():
                self._wait(act)
            case Look():
                return self._look(act)
        return ""

    def _say(self, act: Say) -> None:
        message = getattr(mavlink, f"MAVLink_{act.name.lower()}_message")
        fields = dict(act.fields)
        asked = fields.get("param_id", b"")
        self._asked_parameter = asked.decode() if isinstance(asked, bytes) else ""
        if "target_system" in message.fieldnames:
            fields["target_system"] = self._wire.sysid if act.system is None else act.system
        if "target_component" in message.fieldnames:
            fields["target_component"] = act.component
        self._send(message(**fields), other=act.other)

    def _say_command(self, number: int, *params: float) -> None:
        values = (*params, *(0.0,) * 7)[:7]
        self._send(mavlink.MAVLink_command_long_message(self._wire.sysid, 1, number, 0, *values))

    def _upload(self, act: Upload) -> None:
        self._uploading = act.name
        self._inbox.clear()
        self._send(mavlink.MAVLink_mission_count_message(self._wire.sysid, 1, len(act.items), 0))
        answered = 0
        while True:
            message = self._next(lambda m: m.get_type() in {"MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK"})
            if message is None or (message.get_type() == "MISSION_ACK" and message.type != 13):
                break
            if message.get_type() == "MISSION_ACK":
                continue
            if answered == act.answers:
                break
            answered += 1
            for seq in act.instead.get(message.seq, (message.seq,)):
                self._send(self._item(act.items[seq], current=seq == act.flag, floats=act.floats))
        self._run(act.listen_s)

    def _item(self, item: MissionItem, *, current: bool, floats: bool) -> Any:
        placed = item.x != 0 or item.y != 0
        x, y = (item.x * 1e-7, item.y * 1e-7) if floats and placed else (item.x, item.y)
        kind = mavlink.MAVLink_mission_item_message if floats else mavlink.MAVLink_mission_item_int_message
        return kind(
            self._wire.sysid, 1, item.seq, item.frame, item.command, int(current), 1, item.param1, item.param2,
            item.param3, item.param4, x, y, item.z, 0,
        )  # fmt: skip

    def _download(self, *, floats: bool = False, compare: Sequence[MissionItem] = ()) -> list[str]:
        """Return the mission on board as one line, and what came back changed."""
        self._inbox.clear()
        self._send(mavlink.MAVLink_mission_request_list_message(self._wire.sysid, 1, 0))
        count = self._next(lambda m: m.get_type() in {"MISSION_COUNT", "MISSION_ACK"})
        if count is None:
            return ["on board: no answer"]
        if count.get_type() == "MISSION_ACK":
            return [f"on board: {name_mission_result(count.type)}"]
        request = mavlink.MAVLink_mission_request_message if floats else mavlink.MAVLink_mission_request_int_message
        items: list[Any] = []
        for seq in range(count.count):
            self._send(request(self._wire.sysid, 1, seq, 0))
            item = self._next(lambda m: m.get_type() in {"MISSION_ITEM", "MISSION_ITEM_INT", "MISSION_ACK"})
            if item is None or item.get_type() == "MISSION_ACK":
                items.append("no answer" if item is None else name_mission_result(item.type))
                break
            items.append(item)
        self._send(mavlink.MAVLink_mission_ack_message(self._wire.sysid, 1, 0, 0))
        self._run(0.3)
        kinds = sorted({item.get_type() for item in items if not isinstance(item, str)})
        names = [item if isinstance(item, str) else self._name(item) for item in items]
        said = [f"on board: {' '.join(names) or 'nothing'}"]
        if floats:
            said.append(f"as {' and '.join(kinds)}")
        if compare:
            said += words.rewritten(compare, items, home_item=self._dialect.home_item)
        return said

    def _name(self, item: Any) -> str:
        if item.seq == 0 and self._dialect.home_item:
            return "home"
        scale = 1e7 if item.get_type() == "MISSION_ITEM" else 1
        for (command, x, y), name in self._labels.items():
            if command == item.command and (
                name == "takeoff" or math.dist((x, y), (item.x * scale, item.y * scale)) < 60
            ):
                return name
        return f"command {item.command}"

    # Waiting and looking.

    def _wait(self, act: Until) -> None:
        if act.narrate:
            self._narrate()
        self._until(lambda: self._is(act.what, act.value), act.limit_s, act.what.value, narrate=act.narrate)

    def _is(self, what: What, value: float) -> bool:
        match what:
            case What.READY:
                return self._ready()
            case What.ITEM:
                return bool(self._latest("MISSION_CURRENT").seq == value)
            case What.FAST:
                return self._speed_m_s() >= value
            case What.STILL:
                return self._speed_m_s() < STANDS_M_S
            case What.HIGH:
                return bool(self._latest("GLOBAL_POSITION_INT").relative_alt >= value * 1000)
            case What.DISARMED:
                return not self._armed()

    def _ready(self) -> bool:
        """Healthy sensors, and with ArduPilot an estimate of where it is: it may be armed without in some modes."""
        wanted = {"SYS_STATUS": 1, "EKF_STATUS_REPORT": 193} if self._dialect.home_item else {"SYS_STATUS": 1}
        self._muted = True
        for number in wanted.values():
            self._say_command(mavlink.MAV_CMD_REQUEST_MESSAGE, number)
        self._run(1.0)
        self._muted = False
        if not wanted.keys() <= self._last.keys():
            return False
        healthy = bool(self._latest("SYS_STATUS").onboard_control_sensors_health & READY_BIT)
        return healthy and ("EKF_STATUS_REPORT" not in wanted or self._latest("EKF_STATUS_REPORT").flags & PLACED > 0)

    def _look(self, act: Look) -> str:
        self._run(act.after_s)
        began_s = self._wire.now_s
        wanted = ("HEARTBEAT", "MISSION_CURRENT", "EXTENDED_SYS_STATE", "GLOBAL_POSITION_INT")
        self._run(FRESH_S)
        fresh = {name for name in wanted if self._last.get(name, (-1.0,))[0] >= began_s}
        state = [words.mode(self._dialect.name, self._latest("HEARTBEAT").custom_mode)] if "HEARTBEAT" in fresh else []
        state += [self._motors_and_ground()]
        if self._armed():
            state.append("moving" if self._speed_m_s() > FLIES_M_S else f"standing{self._where()}")
        state.append(self._current() if "MISSION_CURRENT" in fresh else "no MISSION_CURRENT")
        on_board = []
        if act.download:
            self._muted = True
            on_board = self._download()
            self._muted = False
        return "; ".join([", ".join(state), *on_board])

    def _current(self) -> str:
        message = self._latest("MISSION_CURRENT")
        total = "none" if message.total == 65535 else message.total
        number = extension(message, 6)
        identity = f", id of {self._missions.get(number, 'another')}" if self._dialect is PX4 else ""
        return f"item {message.seq} of {total}, {words.MISSION_STATES[message.mission_state]}{identity}"

    def _motors_and_ground(self) -> str:
        landed = words.LANDED_STATES[self._latest("EXTENDED_SYS_STATE").landed_state]
        return f"{'armed' if self._armed() else 'disarmed'}, {landed}"

    def _where(self) -> str:
        """Return the waypoint that it stands at, if there is one."""
        position = self._latest("GLOBAL_POSITION_INT")
        if self._latest("EXTENDED_SYS_STATE").landed_state != IN_AIR:
            return ""
        here = [
            name for (_, x, y), name in self._labels.items() if math.dist((x, y), (position.lat, position.lon)) < 900
        ]
        return f" at {here[0]}" if here else " on its way"

    def _narrate(self) -> None:
        mode = words.mode(self._dialect.name, self._latest("HEARTBEAT").custom_mode)
        now = f"{mode}, {self._motors_and_ground()}"
        if not self._narrated or self._narrated[-1] != now:
            self._narrated.append(now)

    def _latest(self, name: str) -> Any:
        assert name in self._last, f"{name} never came"
        return self._last[name][1]

    def _armed(self) -> bool:
        return bool(self._latest("HEARTBEAT").base_mode & 128)

    def _speed_m_s(self) -> float:
        position = self._latest("GLOBAL_POSITION_INT")
        return math.hypot(position.vx, position.vy) / 100

    # Time and wire.

    def _until(self, good: Any, limit_s: float, what: str, *, narrate: bool = False) -> None:
        until_s = self._wire.now_s + limit_s
        for _ in range(round(20 * limit_s) * 10):
            if good():
                return
            self._pass()
            if narrate:
                self._narrate()
            if self._wire.now_s > until_s:
                break
        raise AssertionError(f"it never came true that {what}; {self._texts[-5:]}")

    def _run(self, seconds: float) -> None:
        until_s = self._wire.now_s + seconds
        while self._wire.now_s < until_s - 1e-6:
            self._pass()

    def _next(self, good: Any) -> Any:
        """Return the next such message, or None when it does not come."""
        until_s = self._wire.now_s + STATION_PATIENCE_S
        while True:
            while self._inbox:
                message = self._inbox.pop(0)
                if good(message):
                    return message
            if self._wire.now_s > until_s:
                return None
            self._pass()

    def _pass(self) -> None:
        if self._wire.now_s - self._beat_s >= BEAT_S:
            self._beat_s = self._wire.now_s
            self._wire.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(self._me))
            self._me.seq = (self._me.seq + 1) % 256
        for datagram in self._wire.listen():
            for message in self._parser.parse_buffer(datagram) or []:
                if message.get_srcSystem() == self._wire.sysid and message.get_srcComponent() == 1:
                    self._hear(message)

    def _send(self, message: Any, *, other: bool = False) -> None:
        packer = self._other if other else self._me
        self._wire.send(message.pack(packer))
        packer.seq = (packer.seq + 1) % 256
        self._active_s = self._wire.now_s

    def _hear(self, message: Any) -> None:
        name, now_s = message.get_type(), self._wire.now_s
        if name == "ATTITUDE":
            self._wire.told_s(message.time_boot_ms / 1000)
        self._last[name] = (now_s, message)
        self._inbox.append(message)
        if name == "STATUSTEXT":
            self._hear_text(message)
            return
        if name == "MISSION_ACK" and message.type == 0 and extension(message, 4):
            self._missions[extension(message, 4)] = self._uploading
        if name == "MISSION_ITEM_REACHED" and message.seq != self._reached:
            self._reached = message.seq
            self._reports.append(f"MISSION_ITEM_REACHED {message.seq}")
        text = describe_answer(message)
        if text is None or self._muted or (name == "PARAM_VALUE" and message.param_id != self._asked_parameter):
            return
        if getattr(message, "target_system", 0) == OTHER_STATION:
            text += " to the other"
        seq = message.seq if name.startswith("MISSION_REQUEST") else None
        self._heard.append(Heard(now_s, now_s - self._active_s, text, seq))
        if seq is None:
            self._active_s = now_s

    def _hear_text(self, message: Any) -> None:
        raw = message.text if isinstance(message.text, str) else message.text.decode("ascii", "replace")
        text = raw.rstrip("\0")
        if self._muted:
            return
        if message.chunk_seq and self._texts:
            # PX4 gives its first long text the id 0, as if it were a short one.
            self._texts[-1] += text
            return
        late_s = self._wire.now_s - self._active_s
        self._texts.append(text.strip() + (f" after {round(late_s)} s" if "timeout" in text else ""))
