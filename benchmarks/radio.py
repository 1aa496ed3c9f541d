"""Flights of a fleet behind one telemetry radio: time to checklist, to missions on board, and to a re-plan on board.

Each flight is that of `benchmarks.virtual_flight` over an emulated radio (`simulator/radio.py`), with one crash. Radio
traffic is counted at the radio's input, heard GCS heartbeats in the vehicles.
"""

from __future__ import annotations

import asyncio
import json
import tempfile
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import typer

from benchmarks.errors import FlightNotFlown
from benchmarks.machine import head, machine, machine_line
from benchmarks.markdown import Rows, figure
from benchmarks.parallel_flights import FlightCase
from benchmarks.prediction import plan_with
from benchmarks.report import Report, Table
from benchmarks.store import Json, Store
from benchmarks.virtual.radio import share_port
from benchmarks.virtual_flight import VirtualFlight, VirtualRun, fly_virtual
from benchmarks.virtual_site import build_virtual_site
from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.frame_layout import EPOCH_UNIX_S, LinkSigning
from executor.core.context import Context
from executor.core.lines import link
from executor.core.state.fleet_state import FleetState
from executor.errors import ExecutorError
from executor.flight.preparation import read_changes
from executor.runtime.flight_loop import Flight
from executor.site.site_model import SiteModel
from missions import PlanFile
from missions.fences import Fence
from missions.geo import LocalFrame
from simulator.config import Signing, SimVehicle
from simulator.messages import Heartbeat, Received
from simulator.radio import GROUND, RADIO_COMPONENT, RADIO_SYSTEM, Radio, parse_radio

SPAN_M = 30.0
SPANS_EACH = 32
"""Segments of each vehicle: some 40 items."""
LOST_S = 45.0
"""Mission time at which the second vehicle crashes."""
LIMIT_S = 1500.0
HOME = LocalFrame(49.6, 15.6, 450.0)
MISSION_ITEM_INT, ITEM_HEAD = 73, 10
ORDERS = frozenset({11, 41, 75, 76})
"""SET_MODE, MISSION_SET_CURRENT, COMMAND_INT and COMMAND_LONG."""
KEPT_BYTES = 600
"""Bytes sent last that are searched for a frame: more than two frames."""
PERIOD_S = 1.0
"""Time between two of our heartbeats."""
LATE_S = 2.0
"""Gap between two GCS heartbeats heard by a vehicle above which one is late: by more than a second."""
STREAM_GONE = link.MISSING.rpartition(", ")[2]
"""Words of a fault over one stream alone."""
KEY = bytes(range(32))
RADIOS = ("sik", "lte", "mlrs-31", "sik-ecc-mended", "sik-ecc", "mesh")


@dataclass(frozen=True, slots=True)
class RadioCase(FlightCase):
    """One flight over one radio."""

    radio: str
    vehicles: int
    signed: bool = False

    def __str__(self) -> str:
        """Return the case in words."""
        frames = "signed" if self.signed else "unsigned"
        return f"{self.radio}, {self.autopilot}, {self.vehicles} vehicles, {frames}, seed {self.seed}"


@dataclass(frozen=True, slots=True)
class RadioFlight:
    """Result of one flight; times in seconds."""

    radio: str
    autopilot: str
    vehicles: int
    seed: int
    signed: bool = False
    commit: str = ""
    failure: str = ""
    """Why it did not fly; empty if it did."""
    asked_s: float | None = None
    """From the first heartbeat to the complete checklist."""
    loaded_s: float | None = None
    """From then until all missions are on board and verified."""
    items: int = 0
    """Items of all first missions."""
    sent_times: float = 0.0
    """Mean number of transmissions of each of these items."""
    sent_most: int = 0
    replan_upload_s: float | None = None
    """From the solver's answer until the last survivor's mission is on board and verified."""
    replan_s: float | None = None
    """From the loss to the same moment."""
    replan_sent_times: float = 0.0
    late_heartbeats: int = 0
    """Number of gaps above `LATE_S` between GCS heartbeats at a vehicle."""
    heartbeat_gap_s: float = 0.0
    """Longest of these gaps."""
    order_wait_s: float = 0.0
    """Longest time between sending an order and its last byte on the air."""
    order_behind_s: float = 0.0
    """The part of that behind other frames, after our radio's first packet since: without its wait for its window."""
    behind_s: float = 0.0
    """The same of any frame: an order sent with it would have waited as long."""
    up_bytes_s: float = 0.0
    cut_bytes: int = 0
    """Bytes cut by a full radio buffer."""
    false_faults: tuple[str, ...] = ()
    """Fault declarations for healthy vehicles."""
    broken: tuple[str, ...] = ()
    """Runs along a segment that did not count."""
    finished: bool = False

    @property
    def wrong(self) -> str:
        """What must not happen in any flight; empty if nothing of it did."""
        left_over = [] if self.finished or self.failure else ["not all inspected"]
        return "; ".join([*([self.failure] if self.failure else []), *self.false_faults, *self.broken, *left_over])


@dataclass(slots=True)
class _Waiting:
    """A frame that our radio has not sent yet."""

    frame: bytes
    since_s: float
    first_s: float = 0.0
    """End of the first packet after that; 0 while there is none."""


@dataclass(slots=True)
class _Buffer:
    """Buffer of our radio, and the longest waits in it."""

    waiting: deque[_Waiting] = field(default_factory=deque)
    sent: bytes = b""
    order_wait_s: float = 0.0
    order_behind_s: float = 0.0
    behind_s: float = 0.0

    def forget_waits(self) -> None:
        """Begin anew, as before the missions nothing but questions is sent."""
        self.order_wait_s = self.order_behind_s = self.behind_s = 0.0

    def send_packet(self, packet: bytes, now_s: float) -> None:
        """Note which frames are complete with this packet; a frame that later ones overtake was cut."""
        self.sent = self.sent[-KEPT_BYTES:] + packet
        for one in self.waiting:
            one.first_s = one.first_s or (now_s if one.since_s < now_s else 0.0)
        for place in reversed(range(len(self.waiting))):
            one = self.waiting[place]
            if one.first_s and one.frame in self.sent:
                break
        else:
            return
        for one in [self.waiting.popleft() for _ in range(place + 1)]:
            if one.frame not in self.sent:
                continue
            self.behind_s = max(self.behind_s, now_s - one.first_s)
            if int.from_bytes(one.frame[7:10], "little") in ORDERS:
                self.order_wait_s = max(self.order_wait_s, now_s - one.since_s)
                self.order_behind_s = max(self.order_behind_s, now_s - one.first_s)


@dataclass(slots=True)
class _Air:
    """Frames sent into the radios, and heartbeats heard by the vehicles."""

    items: Counter[tuple[int, int]] = field(default_factory=Counter)
    up_bytes: int = 0
    heard_s: dict[str, float] = field(default_factory=dict)
    gaps_s: list[float] = field(default_factory=list)
    buffers: list[_Buffer] = field(default_factory=list)

    def take_up(self, data: bytes) -> None:
        """Count a frame of the ground station."""
        self.up_bytes += len(data)
        if len(data) > 40 and int.from_bytes(data[7:10], "little") == MISSION_ITEM_INT:
            # In the payload the sequence number follows seven four-byte numbers; the target comes two bytes later.
            seq, target = int.from_bytes(data[ITEM_HEAD + 28 : ITEM_HEAD + 30], "little"), data[ITEM_HEAD + 32]
            self.items[target, seq] += 1

    def hear(self, vehicle: str, now_s: float) -> None:
        """Record that a vehicle has heard the GCS heartbeat."""
        if vehicle in self.heard_s:
            self.gaps_s.append(now_s - self.heard_s[vehicle])
        self.heard_s[vehicle] = now_s


class RadioRun(VirtualRun):
    """A flight over a radio, with time measurements."""

    def __init__(self, *args: Any, air: _Air, stages: dict[str, float], case: RadioCase) -> None:  # noqa: ANN401
        """Prepare; the arguments are those of a `VirtualRun`, and the records to fill in."""
        super().__init__(*args, radio=case.radio)
        shared = parse_radio(case.radio).profile.shared
        ends = list(self.radios.values())
        for number, behind in enumerate([ends] if shared else [[end] for end in ends]) if case.signed else ():
            signing = LinkSigning(KEY, number, lambda: EPOCH_UNIX_S + asyncio.get_running_loop().time())
            share_port(behind, MavlinkCodec(signing, self._order.site.link.senders))
        self._air, self._stages = air, stages
        self._radios = list({id(one.radio): one.radio for one in self._vehicles.values() if one.radio}.values())
        for one in self._radios:
            _count_sent(one, air)
        for name, vehicle in self._vehicles.items():
            _count_heartbeats(name, vehicle.autopilot, air)

    async def _upload_fences(self, context: Context, first: Mapping[str, Fence]) -> None:
        """Check what a flight would change, as before every flight; nothing changes."""
        await read_changes(context, self.links, self.clock)
        self._stages["asked"] = asyncio.get_running_loop().time()
        for buffer in self._air.buffers:
            buffer.forget_waits()
        await super()._upload_fences(context, first)

    async def _supervise(self, context: Context, state: FleetState, until_s: float) -> tuple[Flight, bool]:
        self._stages["loaded"] = asyncio.get_running_loop().time()
        self._stages["sent"], self._stages["most"] = sum(self._air.items.values()), max(self._air.items.values())
        self._stages["items"] = len(self._air.items)
        self._air.items.clear()
        ended = await super()._supervise(context, state, until_s)
        self._stages["over"] = asyncio.get_running_loop().time()
        self._stages["cut"] = sum(one.cut_bytes for one in self._radios)
        return ended


def _count_sent(radio: Radio, air: _Air) -> None:
    send, deliver, buffer = radio.send, radio.deliver_packet, _Buffer()
    air.buffers.append(buffer)

    def counted(vehicle: int, data: bytes, now_s: float, *, up: bool) -> None:
        if up:
            air.take_up(data)
            buffer.waiting.append(_Waiting(data, now_s))
        send(vehicle, data, now_s, up=up)

    def delivered(number: int, packet: bytes, sent_s: float, took_s: float) -> None:
        if number == GROUND:
            buffer.send_packet(packet, sent_s)
        deliver(number, packet, sent_s, took_s)

    radio.send, radio.deliver_packet = counted, delivered  # type: ignore[method-assign]


def _count_heartbeats(name: str, autopilot: Any, air: _Air) -> None:  # noqa: ANN401
    receive = autopilot.receive

    def counted(received: Received) -> None:
        if isinstance(received.body, Heartbeat):
            air.hear(name, autopilot.now_s)
        receive(received)

    autopilot.receive = counted


def make_site(folder: Path, case: RadioCase) -> tuple[SiteModel, PlanFile]:
    """Return a straight line, and a plan in which every vehicle has a run of it."""
    spans = SPANS_EACH * case.vehicles
    points = [HOME.to_wgs84_deg(SPAN_M * (number + 1), 30.0) for number in range(spans + 1)]
    places = [[round(lon, 7), round(lat, 7)] for lat, lon in points]
    features = [
        {"type": "Feature", "geometry": {"type": kind, "coordinates": place}, "properties": about}
        for kind, place, about in (
            ("Point", [HOME.lon_deg, HOME.lat_deg], {"role": "depot", "elevation_m": HOME.alt_m}),
            *(
                ("Point", place, {"id": f"p{number}", "elevation_m": HOME.alt_m, "height_m": 10.0})
                for number, place in enumerate(places)
            ),
            ("LineString", places, {"id": "line"}),
        )
    ]
    path = folder / "line.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")
    tables: dict[str, dict[str, object]] = {"link": {"one_radio": parse_radio(case.radio).profile.shared}}
    if case.signed:
        tables["link"]["radios"] = [{"system": RADIO_SYSTEM, "component": RADIO_COMPONENT}]
        tables["signing"] = {"key_env": "UNUSED"}
    ground = build_virtual_site(path, None, case.vehicles, case.autopilot, tables=tables)
    routes = {
        name: tuple(2 * visit for visit in range(SPANS_EACH * number, SPANS_EACH * (number + 1)))
        for number, name in enumerate(ground.names)
    }
    return ground, plan_with(ground, routes)


def fly_over_radio(case: RadioCase) -> RadioFlight:
    """Fly once."""
    commit = str(machine()["commit"])
    empty = RadioFlight(case.radio, case.autopilot, case.vehicles, case.seed, case.signed, commit)
    air, stages = _Air(), dict[str, float]()
    with tempfile.TemporaryDirectory(prefix="faultline-radio-") as folder:
        ground, plan = make_site(Path(folder), case)
        lost = ground.names[1]
        try:
            flight = fly_virtual(
                ground, plan, faults=[f"{lost}:crash@{LOST_S:g}s"], seed=case.seed, limit_s=LIMIT_S,
                make=partial(RadioRun, air=air, stages=stages, case=case), craft=_sign if case.signed else _leave,
            )  # fmt: skip
        except (ExecutorError, FlightNotFlown) as error:
            return _judge_ground(replace(empty, failure=str(error)), stages)
    return _judge_air(_judge_ground(empty, stages), flight, air, stages, lost)


def _leave(vehicle: SimVehicle) -> SimVehicle:
    return vehicle


def _sign(vehicle: SimVehicle) -> SimVehicle:
    return replace(vehicle, signing=Signing(KEY, 0))


def fly_and_keep(
    case: RadioCase, folder: Path, fly: Callable[[RadioCase], RadioFlight] = fly_over_radio
) -> RadioFlight:
    """Fly once and write the result to the folder, with a line of progress; what is there already is not flown again.

    Raises:
        BenchError: the folder cannot be written.
    """
    store = Store(folder)
    key, settings = str(case).replace(", ", "-").replace(" ", "-").replace(":", "-"), {"case": str(case)}
    result = store.find_or_make(key, settings, lambda: asdict(fly(case)))
    lists = {name: tuple(result[name]) for name in ("false_faults", "broken")}
    flight = RadioFlight(**{**result, **lists})
    times = (("asked", flight.asked_s), ("loaded", flight.loaded_s), ("re-plan", flight.replan_upload_s))
    figures = [f"{name} {figure(time_s, 1)} s" for name, time_s in times]
    typer.echo(f"{case}: {', '.join(figures)}, {flight.late_heartbeats} late; {flight.wrong or 'right'}", err=True)
    return flight


def _judge_ground(empty: RadioFlight, stages: Mapping[str, float]) -> RadioFlight:
    asked_s, loaded_s = stages.get("asked"), stages.get("loaded")
    if asked_s is None:
        return empty
    if loaded_s is None:
        return replace(empty, asked_s=round(asked_s, 1))
    return replace(
        empty, asked_s=round(asked_s, 1), loaded_s=round(loaded_s - asked_s, 1), items=int(stages["items"]),
        sent_times=round(stages["sent"] / stages["items"], 2), sent_most=int(stages["most"]),
    )  # fmt: skip


def _judge_air(
    known: RadioFlight, flight: VirtualFlight, air: _Air, stages: Mapping[str, float], lost: str
) -> RadioFlight:
    replans = [one for one in flight.report.replans if one.upload_s > 0]
    return replace(
        known,
        replan_upload_s=replans[0].upload_s if replans else None,
        replan_s=replans[0].total_s if replans else None,
        replan_sent_times=round(sum(air.items.values()) / len(air.items), 2) if air.items else 0.0,
        late_heartbeats=sum(gap > LATE_S for gap in air.gaps_s),
        heartbeat_gap_s=round(max(air.gaps_s, default=0.0), 2),
        order_wait_s=round(max(one.order_wait_s for one in air.buffers), 2),
        order_behind_s=round(max(one.order_behind_s for one in air.buffers), 2),
        behind_s=round(max(one.behind_s for one in air.buffers), 2),
        up_bytes_s=round(air.up_bytes / stages["over"], 1),
        cut_bytes=int(stages["cut"]),
        false_faults=tuple(f"{one.vehicle}: {one.reason}" for one in flight.report.faults if one.vehicle != lost),
        broken=tuple(f"{one.vehicle}: {one.reason}" for one in flight.report.not_counted if one.vehicle != lost),
        finished=flight.report.finished,
    )


def make_radio_cases(
    radios: Sequence[str],
    vehicles: Sequence[int],
    autopilots: Sequence[str],
    flights: int,
    seed: int,
    signs: Sequence[bool] = (False,),
) -> list[RadioCase]:
    """Return the flights: all radios with the first seed, then with the next."""
    return [
        RadioCase(number, seed + number, autopilot, radio, count, signed)
        for number in range(flights)
        for radio in radios
        for autopilot in autopilots
        for count in vehicles
        for signed in signs
    ]  # fmt: skip


TITLE = "A fleet behind one telemetry radio"
INTRODUCTION = (
    "`{command}`: {flights} flights in virtual time over a straight line, {spans} spans of {span:g} m for each "
    "vehicle, behind an emulated radio (`faultline simulate --radio`). The second vehicle crashes {lost:g} s into its"
    " mission. `sik-ecc` has the firmware that is sold, which destroys frames, `sik-ecc-mended` has not. LTE and mLRS"
    " are a channel of each vehicle's own. `Asked`: from the first heartbeat to the checklist; `loaded`: all first "
    "missions on board and proven; `re-plan`: from the solver's answer until the last survivor's mission is on board "
    "and proven. `Late` counts the times that a vehicle did not hear our heartbeat for more than {late:g} s, with the"
    " longest. `Order waits`: from the checklist on, the longest time from sending an order until our radio has put "
    "all of it on the air; `behind others`: the part of that after the first packet since, which other frames took; "
    "`any frame`: the same of whatever we sent, as an order sent with it would have waited as long."
)
COLUMNS = (
    "radio", "autopilot", "vehicles", "signed", "seed", "asked (s)", "loaded (s)", "items", "each sent", "re-plan (s)",
    "each sent then", "late", "longest (s)", "order waits (s)", "behind others (s)", "any frame (s)", "sent up (B/s)",
    "false faults", "broken proofs", "all inspected",
)  # fmt: skip


def radio_document(flights: Sequence[RadioFlight], command: str, seed: int) -> Json:
    """Return the content of radio.json: the worst of all flights, or their sum, then each flight."""
    rows = [asdict(one) for one in flights]
    wrong = sum(bool(one.wrong) for one in flights)
    false = [fault for one in flights for fault in one.false_faults]

    def find_longest_s(name: str) -> float | None:
        return max((row[name] for row in rows if row[name] is not None), default=None)

    return {
        **head("radio/1", command), "seed": seed,
        "preflight_s": find_longest_s("asked_s"), "upload_s": find_longest_s("loaded_s"),
        "replan_on_board_s": find_longest_s("replan_upload_s"), "false_losses": len(false),
        "stream_faults": sum(STREAM_GONE in fault for fault in false),
        "proofs_broken": sum(len(one.broken) for one in flights),
        "heartbeat_late_s": round(max((max(0.0, one.heartbeat_gap_s - PERIOD_S) for one in flights), default=0.0), 2),
        "flights": rows, "wrong": wrong,
    }  # fmt: skip


def report_radio(content: Mapping[str, Any]) -> Report:
    """Return the page."""
    said = INTRODUCTION.format(
        command=content["command"], flights=len(content["flights"]), spans=SPANS_EACH, span=SPAN_M, lost=LOST_S,
        late=LATE_S,
    )  # fmt: skip
    rows: Rows = [
        (
            row["radio"], row["autopilot"], str(row["vehicles"]), "yes" if row["signed"] else "no", str(row["seed"]),
            figure(row["asked_s"], 1), figure(row["loaded_s"], 1), str(row["items"]),
            figure(row["sent_times"], 2), figure(row["replan_upload_s"], 1), figure(row["replan_sent_times"], 2),
            str(row["late_heartbeats"]), figure(row["heartbeat_gap_s"], 1),
            *(figure(row[name], 1) for name in ("order_wait_s", "order_behind_s", "behind_s")),
            figure(row["up_bytes_s"], 0),
            str(len(row["false_faults"])), str(len(row["broken"])),
            "yes" if row["finished"] else row["failure"] or "no",
        )
        for row in sorted(content["flights"], key=lambda row: (row["radio"], row["autopilot"], row["vehicles"]))
    ]  # fmt: skip
    return Report("radio", TITLE, content, (machine_line(dict(content["machine"])), said, Table(COLUMNS, rows, TITLE)))
