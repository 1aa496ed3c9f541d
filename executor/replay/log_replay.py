"""Replay recorded flights through the live flight's watchpoints: what they would declare, when, on what evidence.

Time is the log's own clock: ticks come between its records as they come between messages in flight.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import partial

from executor.core.battery.account import NO_PRIOR
from executor.core.battery.kalman import Prior
from executor.core.battery.voltage import NO_FACTS
from executor.core.context import Scene, VehicleSetup, power_draw_table_pct_s
from executor.core.fault_thresholds import Limits
from executor.core.inflight.faults import passive_watch
from executor.core.inflight.faults.link_loss import HOST_PAUSE_S
from executor.core.inflight.faults.passive_watch import DeclaredFault, Degradation, Finding, ObservedModeChange
from executor.core.interface import messages
from executor.core.interface.events import Heard, Tick
from executor.core.interface.recorded_log import Record, RecordedFile, SkippedRecords
from executor.core.state import legs
from executor.core.state.vehicle_state import FaultKind, Stage, VehicleState
from executor.core.telemetry.battery_reports import pack_facts_of
from executor.core.telemetry.vehicle_identity import describe_autopilot, describe_foreign_system, describe_vehicle_type
from executor.replay import replay_result
from executor.site import site_model
from executor.site.site_file import Site
from missions import AUTOPILOTS, Dialect, LocalFrame, dialect_of
from planner import PRESETS

TICK_S = 0.25
CALM_TICK_S = 1.8
"""Seconds between ticks while all vehicles are heard and no watchpoint fails; relevant changes cause a tick at once."""
RESTLESS_PCT = 1.2
"""Excess consumption from which ticks are frequent."""
FALLS = 0.03
"""Voltage drop between two reports, as a share, that causes a tick at once."""
CALM_S = 1.2
"""Longest silence that counts as calm: the heartbeat's interval of one second, and some delay."""
LINK_TIMEOUT_S = 4.5
"""Link time-out without a site file. No task is reassigned, so no failsafe must be waited for: four heartbeats are
missed, and the fifth is half an interval late (mavlink.io: radio links miss four or five; MAVProxy uses 5 s)."""
LINK_STALE_S = 2.0
"""Age of a stale link: one heartbeat is missed, and with it every other message."""
ANY_DRONE = Prior(2.5, 2.5, slack=0.5)
"""Prior relative to the Mavic 3, whose speed curve is used if no site names the drone: any drone with at least the five
minutes of a racer, so that its own flight alone tells what is normal."""
NOBODY_KNOWS = "no site names the drone, so its consumption is unknown: only a change within its own flight is judged"
COPTERS = frozenset({2, 3, 4, 13, 14, 15, 29, 35})
"""MAV_TYPE of vehicles with rotors."""
BACK_USEC = 1_000_000
"""Records out of order by less than this count as simultaneous."""
LONGEST_GAP_S = 120.0
"""Longest gap in which decisions are still made; over a longer one, only earlier decisions stand."""
MIXED_S = 10.0
"""Seconds before two vehicles with one id are told apart in which their messages may already be mixed."""
MOST_EARLY, MOST_SETTINGS = 16, 500
"""Most systems, and parameters of each, kept until its first HEARTBEAT."""
STEADY = frozenset({Stage.GROUND, Stage.FLYING, Stage.LANDED})
"""Stages in which an unchanged HEARTBEAT has no effect."""
REPEATS_S = 2.5
SAME, ALIKE = 0.003, 0.05
"""Relative changes of voltage and current within `REPEATS_S` that count as unchanged."""


@dataclass(frozen=True, slots=True)
class ReplayRules:
    """Rules for judging a log."""

    limits: Limits = field(default_factory=lambda: Limits(link_stale_s=LINK_STALE_S))
    link_timeout_s: float = LINK_TIMEOUT_S
    """Link time-out if no site sets it."""
    site: Site | None = None


def build_replay_rules(site: Site | None) -> ReplayRules:
    """Return the rules of a site, or those without one."""
    return ReplayRules() if site is None else ReplayRules(limits=site_model.build_limits(site), site=site)


def replay_log(file: RecordedFile, rules: ReplayRules) -> replay_result.LogReplay:
    """Replay one log.

    Args:
        file: The log, read once from its beginning.
        rules: Thresholds, and what is known of the vehicles.
    """
    player = _Player(rules, file)
    for record in file.read_records():
        player.play_record(record)
    return player.build_result()


_TICK = Tick()


@dataclass(slots=True)
class LogClock:
    """A log's time in seconds since its beginning; never runs back."""

    skipped: SkippedRecords
    """Counts how often the log's own clock jumped back."""
    began_usec: int | None = None
    _last_usec: int = 0
    _shift_usec: int = 0

    def advance(self, t_usec: int) -> float:
        """Return the time of the next record."""
        if self.began_usec is None:
            self.began_usec = self._last_usec = t_usec
        back_usec = self._last_usec - t_usec
        if back_usec > BACK_USEC:
            self.skipped.time_back += 1
            self._shift_usec += back_usec
        self._last_usec = t_usec if back_usec > BACK_USEC else max(t_usec, self._last_usec)
        return self.to_s(self._last_usec)

    def to_s(self, t_usec: int) -> float:
        """Return the time of a moment on the log's own clock."""
        return (t_usec - (self.began_usec or 0) + self._shift_usec) / 1e6

    def to_usec(self, at_s: float) -> int:
        """Return a moment on the log's clock, as if it had never jumped back."""
        return (self.began_usec or 0) + round(at_s * 1e6)


@dataclass(slots=True)
class _Flight:
    """A flight, from one arming to the next."""

    began_s: float
    took_off: bool = False
    mission: bool = False


@dataclass(slots=True)
class FlightBook:
    """Notes on a vehicle's flights."""

    flights: list[_Flight] = field(default_factory=list)

    def begin_flight(self, at_s: float) -> None:
        """Begin a flight."""
        self.flights.append(_Flight(at_s))

    def update(self, vehicle: VehicleState) -> None:
        """Update the notes on the current flight."""
        if not self.flights or not vehicle.armed:
            return
        flight = self.flights[-1]
        flight.took_off |= vehicle.sortie.took_off
        flight.mission |= vehicle.sortie.flew_mission

    def describe_missionless(self, name: str) -> str:
        """Return in words which flights had no mission; empty if all had one."""
        flown = [one for one in self.flights if one.took_off]
        by_hand = [one for one in flown if not one.mission]
        if not by_hand:
            return ""
        which = "flown" if len(flown) == 1 else f"{len(by_hand)} of its {len(flown)} flights"
        since = f"at {by_hand[0].began_s:.1f} s" if len(by_hand) == 1 else f"the first at {by_hand[0].began_s:.1f} s"
        what = "no inspection that could be interrupted; its battery, its link and a crash are watched for"
        return f"{name}: {which} by hand, or without a mission ({since}): {what}"


@dataclass(slots=True)
class FollowedVehicle:
    """Data about a vehicle besides its state."""

    trace: replay_result.SampleTrace = field(default_factory=replay_result.SampleTrace)
    packs: replay_result.PackBook = field(default_factory=replay_result.PackBook)
    flights: FlightBook = field(default_factory=FlightBook)
    flown_s: float = 0.0
    beat_s: float | None = None
    """Time of an unchanged heartbeat since the last tick."""
    reports: dict[int | None, tuple[float, messages.Battery | messages.SystemStatus]] = field(default_factory=dict)
    """Last new report of each battery, and of SYS_STATUS."""
    mixed_s: float = math.inf
    """Time since which two vehicles use its name."""

    def observe(self, scene: Scene, vehicle: VehicleState, at_s: float, since_s: float) -> None:
        """Note its condition, valid since the last tick."""
        if vehicle.armed and vehicle.stage is not Stage.LOST:
            self.flown_s += at_s - since_s
        self.trace.add(at_s, partial(sample_vehicle, scene, vehicle, at_s))

    def build_replay(
        self, setup: VehicleSetup, found: Iterable[Finding], to_usec: Callable[[float], int], ended_s: float
    ) -> replay_result.VehicleReplay:
        """Return its findings, in the log's own time; conditions not over by then last to the end."""
        mine = [one for one in found if one.vehicle == setup.name]
        degraded = sorted((one for one in mine if isinstance(one, Degradation)), key=lambda one: one.from_s)
        return replay_result.VehicleReplay(
            sysid=setup.sysid,
            name=setup.name,
            autopilot=setup.dialect.name,
            declarations=tuple(
                replay_result.Declaration(one.kind, one.reason, to_usec(one.at_s), one.evidence)
                for one in mine
                if isinstance(one, DeclaredFault)
            ),
            degraded=tuple(
                replay_result.ImpairedPeriod(
                    one.kind, one.reason, to_usec(one.from_s), to_usec(one.to_s or ended_s), one.evidence
                )
                for one in degraded
            ),
            flown_s=self.flown_s,
            samples=tuple(self.trace.samples),
            packs=self.packs.close_flights(),
            modes=tuple(
                replay_result.ModeTransition(to_usec(one.at_s), one.mode, one.by, one.why)
                for one in mine
                if isinstance(one, ObservedModeChange)
            ),
        )


def is_known_copter(beat: messages.Heartbeat) -> bool:
    """Return whether a vehicle can be followed: only copters, as others have other modes and no energy model here."""
    return dialect_of(beat.autopilot) is not None and beat.vehicle_type in COPTERS


class _Player:
    """Feed records and ticks to the passive core; owns the time."""

    def __init__(self, rules: ReplayRules, file: RecordedFile) -> None:
        self._rules, self._file = rules, file
        self._scene = _build_empty_scene(rules)
        self._state = passive_watch.PassiveWatch()
        self._names: dict[int, str] = {}
        self._others: dict[int, str] = {}
        """Systems that are not followed, and why."""
        self._clock = LogClock(file.skipped)
        self._now_s = 0.0
        self._next_s = 0.0
        self._findings: list[Finding] = []
        self._followed: dict[str, FollowedVehicle] = {}
        self._framed = False
        self._ticked_s = 0.0
        self._early: dict[int, dict[str | int, messages.VehicleSetting | messages.ListedItem]] = {}
        """Parameters and mission items of systems without a HEARTBEAT so far."""

    def play_record(self, record: Record) -> None:
        """Advance time to a record, and process its message."""
        t_usec, system, message = record
        now_s = self._clock.advance(t_usec)
        if now_s >= self._next_s:
            self._advance_to(now_s)
        self._now_s = now_s
        if message is None:
            return
        if system == 0:
            for name in self._names.values():
                self._handle_message(name, message, now_s)
            return
        self._route(system, message, now_s)

    def _route(self, system: int, message: messages.FlightMessage, now_s: float) -> None:
        """Route a message to its vehicle, or count why it is dropped."""
        name = self._names.get(system) or self._add_vehicle(system, message)
        if name and isinstance(message, messages.DoubleHeard):
            vehicle = self._followed[name]
            vehicle.mixed_s = min(vehicle.mixed_s, max(0.0, now_s - MIXED_S))
        if name:
            self._handle_message(name, message, now_s)
            for setting in self._early.pop(system, {}).values():
                self._handle_message(name, setting, now_s)
        elif system in self._others:
            self._file.skipped.not_followed += 1
        elif isinstance(message, messages.VehicleSetting | messages.ListedItem):
            self._keep_setting(system, message)
        else:
            self._file.skipped.before_heartbeat += 1

    def _keep_setting(self, system: int, setting: messages.VehicleSetting | messages.ListedItem) -> None:
        """Keep a vehicle's parameters and mission items until its type is known."""
        kept = self._early.setdefault(system, {})
        name = setting.item.seq if isinstance(setting, messages.ListedItem) else setting.name
        if len(self._early) <= MOST_EARLY and (len(kept) < MOST_SETTINGS or name in kept):
            kept[name] = setting
        else:
            self._file.skipped.before_heartbeat += 1

    def _advance_to(self, now_s: float) -> None:
        """Tick up to a time; a gap in the recording is one tick, as when the program was suspended."""
        gap_s = now_s - self._now_s
        if gap_s > LONGEST_GAP_S or (gap_s > HOST_PAUSE_S and (self._file.stations or self._file.on_board)):
            self._file.skipped.gaps += 1
            self._next_s = now_s
            if gap_s > LONGEST_GAP_S:
                self._ticked_s = now_s  # whether it flew meanwhile is unknown
        while self._next_s <= now_s:
            self._next_s += self._tick(self._next_s)

    def _tick(self, at_s: float) -> float:
        """Run all watchpoints; return the time of the next tick."""
        for system, name in self._names.items():
            usec = self._file.heard.get(system)
            if usec is not None:
                heard_s = min(at_s, self._clock.to_s(usec))
                followed = self._followed[name]
                beat_s, followed.beat_s = followed.beat_s, None
                self._state = passive_watch.record_contact(self._state, name, heard_s, beat_s)
        self._state, found = passive_watch.step_watch(self._scene, self._state, _TICK, at_s)
        self._findings += found
        calm = True
        for name, vehicle in self._state.fleet.vehicles.items():
            followed = self._followed[name]
            followed.observe(self._scene, vehicle, at_s, self._ticked_s)
            calm = calm and _is_calm(vehicle, at_s)
            followed.packs.update(vehicle, pack_facts_of(self._scene, vehicle), at_s)
            followed.flights.update(vehicle)
        self._ticked_s = at_s
        return CALM_TICK_S if calm else TICK_S

    def _handle_message(self, name: str, message: messages.FlightMessage, now_s: float) -> None:
        before = self._state.fleet.vehicles[name]
        if self._is_repetition(before, message, now_s):
            return
        if isinstance(message, messages.Battery):
            volts = before.power.volts.voltage_v
            if volts is not None and message.voltage_v is not None and message.voltage_v < (1.0 - FALLS) * volts:
                self._next_s = now_s
        elif isinstance(message, messages.StatusText | messages.OwnFailsafe):
            self._next_s = now_s  # a crash report is evaluated before anything that follows it
        elif isinstance(message, messages.Position) and not self._framed:
            self._framed = True
            frame = LocalFrame(message.lat_deg, message.lon_deg, message.alt_msl_m)
            self._scene = replace(self._scene, frame=frame)
        self._state, found = passive_watch.step_watch(self._scene, self._state, Heard(name, message), now_s)
        self._findings += found
        if isinstance(message, (messages.Battery, messages.SystemStatus)) and _is_draining(
            self._state.fleet.vehicles[name]
        ):
            self._next_s = min(self._next_s, now_s + TICK_S)
        elif isinstance(message, messages.Heartbeat):
            if message != before.telemetry.heartbeat:
                self._next_s = now_s
            if message.armed and not before.armed:
                self._followed[name].flights.begin_flight(now_s)
                self._record_take_off_place(self._state.fleet.vehicles[name])

    def _is_repetition(self, known: VehicleState, message: messages.FlightMessage, now_s: float) -> bool:
        """Return whether a message repeats the last one: watchpoints need only changes, and signs of life."""
        match message:
            case messages.Heartbeat():
                settled = known.stage in STEADY and (known.sortie.flew_mission or not known.sortie.took_off)
                if not settled or message != known.telemetry.heartbeat:
                    return False
                self._followed[known.name].beat_s = now_s  # the next tick handles it
                return True
            case messages.MissionCurrent(seq, total, number):
                same = known.assignment.board is None or number in {None, known.assignment.carried.id}
                return same and known.telemetry.item == (seq, total)
            case messages.Battery() | messages.SystemStatus():
                return _is_report_repetition(self._followed[known.name], message, now_s)
            case _:
                return False

    def _record_take_off_place(self, vehicle: VehicleState) -> None:
        """Note the take-off position of a vehicle: its home for RTL."""
        if vehicle.motion.fix is not None:
            setup = replace(self._scene.vehicles[vehicle.name], pad_m=vehicle.motion.fix.place_m)
            self._scene = replace(self._scene, vehicles={**self._scene.vehicles, vehicle.name: setup})

    def _add_vehicle(self, system: int, message: messages.FlightMessage) -> str:
        """Return the name of a new vehicle; empty if it cannot be followed."""
        if not isinstance(message, messages.Heartbeat):
            return ""
        dialect = dialect_of(message.autopilot)
        if dialect is None or not is_known_copter(message):
            self._others[system] = (
                f"system {system} is not followed: {describe_vehicle_type(message.vehicle_type)} with "
                f"{describe_autopilot(message.autopilot)} (MAV_TYPE {message.vehicle_type}, "
                f"MAV_AUTOPILOT {message.autopilot}); "
                f"known are copters with {' or '.join(one.title for one in AUTOPILOTS)}"
            )
            return ""
        self._others.pop(system, None)  # the reason from before its frame was known
        setup = _build_setup(self._rules, system, dialect, on_board=self._file.on_board)
        self._scene = replace(self._scene, vehicles={**self._scene.vehicles, setup.name: setup})
        self._state = replace(self._state, fleet=self._state.fleet.put(VehicleState(setup.name)))
        self._names[system] = setup.name
        self._followed[setup.name] = FollowedVehicle()
        return setup.name

    def build_result(self) -> replay_result.LogReplay:
        if self._clock.began_usec is not None:
            # Its last messages are evaluated, too.
            self._next_s = min(self._next_s, self._now_s)
            self._advance_to(self._now_s)
        found = [*self._findings, *passive_watch.close_degradations(self._state, self._now_s)]
        if self._file.on_board:
            found = [one for one in found if isinstance(one, ObservedModeChange) or one.kind is not FaultKind.LINK]
        found = [one for one in found if _began_s(one) < self._followed[one.vehicle].mixed_s]
        vehicles = tuple(
            self._followed[name].build_replay(self._scene.vehicles[name], found, self._clock.to_usec, self._now_s)
            for _, name in sorted(self._names.items())
        )
        notes = [*self._others.values(), *self._file.notes]
        notes += [
            f"{describe_foreign_system(messages.DoubleHeard(self._scene.vehicles[name].sysid, ()))}; not judged from "
            f"{one.mixed_s:.1f} s on"
            for name, one in self._followed.items() if one.mixed_s < math.inf
        ]  # fmt: skip
        if self._rules.site is None and any(one.flown_s and self._followed[one.name].mixed_s == math.inf
                                            for one in vehicles):  # fmt: skip
            notes.append(NOBODY_KNOWS)
        notes += [f"{one.name} is never armed in it" for one in vehicles if not one.flown_s]
        notes += [note for name, one in self._followed.items() if (note := one.flights.describe_missionless(name))]
        if not vehicles:
            notes.insert(0, "no vehicle in it that can be followed")
        return replay_result.LogReplay(
            self._file.path, vehicles, self._file.skipped, self._clock.began_usec or 0, self._now_s, tuple(notes)
        )


def _is_report_repetition(
    followed: FollowedVehicle, message: messages.Battery | messages.SystemStatus, now_s: float
) -> bool:
    key = message.battery if isinstance(message, messages.Battery) else None
    at_s, known = followed.reports.get(key, (-math.inf, message))
    same = message.remaining_pct == known.remaining_pct and _is_within(message.voltage_v, known.voltage_v, SAME)
    match message, known:
        case messages.Battery(), messages.Battery():
            same = same and (message.charge_state, message.faults) == (known.charge_state, known.faults)
            same = same and not message.cells_v and _is_within(message.current_a, known.current_a, ALIKE)
        case messages.SystemStatus(), messages.SystemStatus():
            same = same and (message.unhealthy, message.prearm_ok) == (known.unhealthy, known.prearm_ok)
    if same and now_s - at_s < REPEATS_S:
        return True
    followed.reports[key] = (now_s, message)
    return False


def _is_within(value: float | None, known: float | None, share: float) -> bool:
    return abs((value or 0.0) - (known or 0.0)) <= share * (known or 0.0)


def _began_s(found: Finding) -> float:
    return found.from_s if isinstance(found, Degradation) else found.at_s


def _is_calm(vehicle: VehicleState, at_s: float) -> bool:
    if vehicle.stage in {Stage.LOST, Stage.GROUND, Stage.LANDED}:
        return True
    silent = vehicle.link.heard_s is not None and at_s - vehicle.link.heard_s > CALM_S
    return not (silent or vehicle.watches or _is_draining(vehicle))


def _is_draining(vehicle: VehicleState) -> bool:
    known = vehicle.power.battery
    return max(known.drift.excess_pct, known.charge.drift.excess_pct) > RESTLESS_PCT


def _build_empty_scene(rules: ReplayRules) -> Scene:
    site = rules.site
    drone = PRESETS["mavic3"] if site is None else site_model.drone_of(site)
    return Scene(
        frame=LocalFrame(0.0, 0.0),
        vehicles={},
        limits=rules.limits,
        drone=drone,
        draws_pct_s=power_draw_table_pct_s(drone),
        wind_m_s=(0.0, 0.0) if site is None else site.inspection.wind_m_s,
        corridor_m=math.inf,
        inspection_speed_m_s=math.inf,
    )


def _build_setup(rules: ReplayRules, system: int, dialect: Dialect, *, on_board: bool) -> VehicleSetup:
    site = rules.site
    table = None if site is None else next((one for one in site.vehicle if one.sysid == system), None)
    timeout_s = rules.link_timeout_s if site is None else site_model.link_timeout_s(site, dialect)
    return VehicleSetup(
        name=str(system) if table is None else table.name,
        sysid=system,
        dialect=dialect,
        budget_pct=100.0 if table is None else table.budget_pct,
        reserve_pct=0.0 if table is None else table.reserve_pct,
        link_timeout_s=math.inf if on_board else timeout_s,
        pad_m=(0.0, 0.0),
        planned=False,
        prior=ANY_DRONE if site is None else NO_PRIOR,
        pack=NO_FACTS if site is None else site_model.pack_of(site),
    )


def sample_vehicle(scene: Scene, vehicle: VehicleState, at_s: float) -> replay_result.ReplaySample:
    """Return a sample of a vehicle for pictures."""
    estimate = vehicle.power.battery.estimate
    ahead = legs.project_landing(scene, vehicle, scene.vehicles[vehicle.name])
    return replay_result.ReplaySample(
        at_s=at_s,
        remaining_pct=vehicle.power.battery.remaining_pct,
        estimate_pct=None if estimate is None else estimate.remaining_pct,
        sd_pct=None if estimate is None else math.sqrt(estimate.var_remaining),
        landing_pct=None if ahead is None else ahead.mean_pct,
        voltage_v=vehicle.power.volts.voltage_v,
        link_age_s=0.0 if vehicle.link.heard_s is None else at_s - vehicle.link.heard_s,
        heartbeat_age_s=0.0 if vehicle.link.heartbeat_s is None else at_s - vehicle.link.heartbeat_s,
        item=None if vehicle.telemetry.item is None else vehicle.telemetry.item[0],
        height_m=None if vehicle.motion.fix is None else vehicle.motion.fix.alt_rel_m,
    )
