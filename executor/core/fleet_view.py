"""Describe the present as plain values: the one description that the page and MQTT publish."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from executor.core import formatting
from executor.core.battery.kalman import BAND_SD
from executor.core.context import Context
from executor.core.ground import pack_count, turnaround
from executor.core.ground.takeoff_offers import describe_offer
from executor.core.imaging import asset_status
from executor.core.inflight import channel_watch
from executor.core.inflight.custody.mode_causes import is_holding
from executor.core.interface.codes import ChannelCode, Check
from executor.core.interface.messages import Wind
from executor.core.interface.ports import LinkView
from executor.core.radio_budget import GLOBAL_POSITION_INT
from executor.core.replanning.replan_cycle import find_left_over_segments
from executor.core.state import legs, radio_channel
from executor.core.state.bases import is_at_closed_base, landing_base_of, place_vehicles
from executor.core.state.fleet_state import FleetState, OperatorLine, Question
from executor.core.state.vehicle_parts import PositionFix
from executor.core.state.vehicle_position import accuracy_of
from executor.core.state.vehicle_state import FaultCode, Stage, VehicleState, current_setup_of
from missions import Phase
from missions.autopilots.dialect import mode_name

SAID_LINES = 60
INTENTS = 30
MOVING_M_S = 0.5
"""Ground speed above which the course counts as heading for a vehicle without a compass."""
WHOLE_PCT = 1.0 / math.sqrt(12.0)
"""Standard deviation of a percentage reported in whole percent."""


@dataclass(frozen=True, slots=True)
class PlaceView:
    """A position of a vehicle, and its speed there."""

    lat_deg: float
    lon_deg: float
    relative_alt_m: float
    """Over its own home."""
    ground_speed_m_s: float
    age_s: float
    accuracy_m: float | None = None
    """Position error; a lower bound for a dead-reckoned position."""


@dataclass(frozen=True, slots=True)
class PositionView(PlaceView):
    """The position of a vehicle."""

    heading_deg: float | None = None
    known: str = "unsaid"
    """fix: with GPS. reckoned: GPS is lost, dead-reckoned since. unsaid: the vehicle has not reported its GPS."""
    last_fix: PlaceView | None = None
    """For a dead-reckoned position, the last one with GPS: the place to begin a search."""


@dataclass(frozen=True, slots=True)
class BatteryView:
    """A battery, in percent of a full one. A band should contain the actual value nine times in ten."""

    measured_pct: float | None
    predicted_pct: float | None
    """Modelled charge at present."""
    predicted_band_pct: float | None
    to_finish_pct: float
    """Energy still needed for the mission on board."""
    landing_pct: float | None
    """Expected charge at landing, from measurements."""
    landing_band_pct: float | None
    reserve_pct: float


@dataclass(frozen=True, slots=True)
class ProgressView:
    """The progress of a vehicle on its route."""

    done: int
    """Segments of its route behind it."""
    total: int
    segment: int | None = None
    """The segment that it inspects or flies to."""
    segment_name: str | None = None
    """The same by its asset's name."""
    phase: str | None = None
    """takeoff, transit, inspect, return or land."""
    segment_share: float | None = None
    """Share of the segment behind it, from 0 to 1."""
    inspected: int = 0
    """Segments it has inspected, on this route and earlier ones."""


@dataclass(frozen=True, slots=True)
class LossView:
    """The effect of a vehicle's loss."""

    inside_window: bool
    """Whether the others could still finish all segments but those left over anyway."""
    uncovered: tuple[int, ...]
    """Segments that they could not."""
    age_s: float
    """Age of the result."""
    left_over: tuple[int, ...] = ()
    """Segments left over in any case: `uncovered` of the fleet."""


@dataclass(frozen=True, slots=True)
class TakenView:
    """A vehicle under another party's control: it is not commanded from here."""

    since_s: float
    """On the flight's clock."""
    kept_s: float
    """Time for which its segments are still reserved for it; 0 once reassigned."""
    returned: bool
    """Whether its pilot has returned it to its mission: it may be included."""


@dataclass(frozen=True, slots=True)
class TurnView:
    """A vehicle at its base between two sorties, or on a later one."""

    pack: str
    """Id of its pack as entered by the crew; empty if none."""
    sortie: int
    """The sortie under way, or the next, from 1."""
    awaited: bool
    """Whether it waits for the crew's report of a pack change."""
    text: str
    """What it waits for, in words; empty for nothing."""
    base: str = ""
    """Its base of the day; empty if the flight is no day of sorties."""
    base_closed: bool = False
    """Whether take-offs from there are closed."""
    packs: int | None = None
    """Charged packs there; None if they are not counted."""


@dataclass(frozen=True, slots=True)
class VehicleView:
    """One vehicle."""

    name: str
    sysid: int
    state: str
    """ground, starting, flying, holding, pilot, returning, landing, landed, down or lost."""
    mode: str | None
    armed: bool
    layer: int
    """0 is the lowest."""
    layer_m: float
    """Height of its layer over the lowest one."""
    position: PositionView | None
    battery: BatteryView
    link_age_s: float | None
    link_loss: float | None
    """Share of frames lost in the last seconds."""
    links: tuple[LinkView, ...]
    """Each of its links, where it has several."""
    stale: bool
    progress: ProgressView
    fault: str | None
    fault_kind: str | None
    fault_code: FaultCode | None
    excluded: bool
    loss: LossView | None
    """None while unknown, or where there is nothing to lose."""
    lands_in_s: float | None
    """Expected time until it is back on its pad; None if unknown."""
    gps_fix: int | None
    """GPS_FIX_TYPE."""
    satellites: int | None
    voltage_v: float | None
    wind: Wind | None
    """As the vehicle measures it."""
    taken: TakenView | None
    """The party that controls it, if not this flight."""
    offered: bool
    """Whether it could take over segments, and waits for the crew's include."""
    turn: TurnView | None
    """None in a flight of one sortie."""


@dataclass(frozen=True, slots=True)
class OfferView:
    """Vehicles on the ground that could take over segments."""

    vehicles: tuple[str, ...]
    segments: tuple[int, ...]
    """Segments without a vehicle."""
    text: str
    """The pads that must be clear, and the purpose."""


@dataclass(frozen=True, slots=True)
class ReplanView:
    """A re-plan under way."""

    revision: int
    trigger: str
    solving: bool
    pending: tuple[str, ...]
    """Vehicles whose new mission is not on board yet."""


@dataclass(frozen=True, slots=True)
class IntentView:
    """An operator's intent and its outcome."""

    id: str
    action: str
    vehicle: str | None
    source: str
    outcome: str
    text: str
    at_s: float
    question: str
    """The question to confirm first; empty if there is none."""


@dataclass(frozen=True, slots=True)
class RadioView:
    """A telemetry radio, as measured in the last seconds with all vehicles behind it."""

    vehicles: tuple[str, ...]
    state: str
    """fine, congested or weak."""
    code: ChannelCode | None
    """The reason; None if it is fine."""
    text: str
    """Load and capacity, round trip and losses, in words."""
    bytes_s: float
    capacity_bytes_s: float
    round_trip_s: float | None
    lost: float | None
    """Share of frames lost; None while there are too few."""
    positions_hz: float
    """Requested position rate of its vehicles."""


@dataclass(frozen=True, slots=True)
class FleetView:
    """The flight at one moment."""

    now_s: float
    """The flight's clock."""
    flight_s: float | None
    """Since launch."""
    revision: int
    segments_total: int
    inspected: tuple[int, ...]
    uncovered: tuple[int, ...]
    """Segments not inspected in this flight: left over by the plan, or given up since."""
    missed: tuple[int, ...]
    """Segments flown but not seen: pictures are missing."""
    replan: ReplanView | None
    all_silent: bool
    """Whether no vehicle is received."""
    recalled: bool
    finished: bool
    min_separation_m: float | None
    vehicles: tuple[VehicleView, ...]
    said: tuple[OperatorLine, ...]
    """The last decisions, oldest first."""
    intents: tuple[IntentView, ...]
    """The last ones, oldest first."""
    checks: tuple[Check, ...]
    """The checklist, in the crew's reading order."""
    question: Question | None
    """The open question to the crew before the flight."""
    offer: OfferView | None
    radios: tuple[RadioView, ...] = ()
    """For vehicles behind telemetry radios, once their load is measured."""


LinksNow = Callable[[str], tuple[LinkView, ...]]
"""Returns the links of a vehicle that has several; called from another thread."""


def build_fleet_view(context: Context, state: FleetState, now_s: float, links: LinksNow = lambda _: ()) -> FleetView:
    """Return the flight as known at `now_s`."""
    context = place_vehicles(context, state.vehicles.values())
    plan = state.replanning.replan
    by = Counter(state.coverage.inspected.values())
    return FleetView(
        now_s=round(now_s, 2),
        flight_s=None if state.progress.launched_s is None else round(now_s - state.progress.launched_s, 2),
        revision=state.replanning.revision,
        segments_total=context.segments,
        inspected=tuple(sorted(state.coverage.inspected)),
        uncovered=_list_uncovered(state),
        missed=tuple(sorted(asset_status.find_missed_segments(context, state))),
        replan=None
        if plan is None
        else ReplanView(plan.solve.revision, plan.solve.trigger, plan.solve_s is None, tuple(sorted(plan.pending))),
        all_silent=state.listening.silent_since_s is not None,
        recalled=state.progress.recalled,
        finished=state.progress.finished,
        min_separation_m=None if state.progress.separation_m is None else round(state.progress.separation_m, 2),
        vehicles=tuple(
            replace(_build_vehicle_view(context, state, vehicle, now_s, by[name]), links=links(name))
            for name, vehicle in state.vehicles.items()
        ),
        said=state.crew.said[-SAID_LINES:],
        intents=tuple(
            IntentView(
                one.intent.id, one.intent.action.value, one.intent.vehicle, one.intent.source, one.outcome.value,
                one.text, round(one.at_s, 2), one.question,
            )
            for one in tuple(state.crew.intents.values())[-INTENTS:]
        ),
        checks=state.crew.briefing.checks,
        question=state.crew.briefing.question,
        offer=None
        if state.crew.offer is None
        else OfferView(state.crew.offer.vehicles, state.crew.offer.segments, describe_offer(context, state.crew.offer)),
        radios=tuple(_build_radio_views(context, state, now_s)),
    )  # fmt: skip


def _build_radio_views(context: Context, state: FleetState, now_s: float) -> Iterator[RadioView]:
    for share in channel_watch.list_channels(context):
        vehicles = [state.vehicles[name] for name in share.names]
        found = radio_channel.measure_channel(share, vehicles, now_s)
        if found is None:
            continue
        known = state.channels.get(share.names[0], radio_channel.ChannelState())
        streams_hz = radio_channel.choose_streams_hz(context.vehicles[share.names[0]], vehicles[0])
        yield RadioView(
            share.names,
            "fine" if known.told is None else "congested" if known.told.is_congestion else "weak",
            known.told,
            radio_channel.describe_figures(found),
            round(found.bytes_s),
            round(found.capacity_bytes_s),
            found.round_trip_s,
            None if found.lost is None else round(found.lost, 3),
            streams_hz[GLOBAL_POSITION_INT],
        )


def _list_uncovered(state: FleetState) -> tuple[int, ...]:
    return tuple(sorted((state.coverage.given_up | find_left_over_segments(state)) - set(state.coverage.inspected)))


def _build_vehicle_view(
    context: Context, state: FleetState, vehicle: VehicleState, now_s: float, inspected: int
) -> VehicleView:
    setup, layers = current_setup_of(context, vehicle), context.setup.layers
    outlook = state.replanning.outlook.get(vehicle.name)
    known = outlook is not None and vehicle.fault is None and vehicle.stage in {Stage.STARTING, Stage.FLYING}
    lost = vehicle.link.quality.lost
    board = vehicle.assignment.board if vehicle.stage is Stage.FLYING and vehicle.orders.held_s is None else None
    return VehicleView(
        name=vehicle.name,
        sysid=setup.sysid,
        state=vehicle_state_word(context, vehicle),
        mode=None if vehicle.mode is None else mode_name(setup.dialect, vehicle.mode),
        armed=vehicle.armed,
        layer=layers.vehicles.index(vehicle.name),
        layer_m=layers.offset_m(vehicle.name),
        position=position_view(context, vehicle, now_s),
        battery=_build_battery_view(context, vehicle),
        link_age_s=None if vehicle.link.heard_s is None else round(max(0.0, now_s - vehicle.link.heard_s), 1),
        link_loss=None if lost is None else round(lost, 3),
        links=(),
        stale=vehicle.link.stale,
        progress=replace(_build_progress_view(context, vehicle), inspected=inspected),
        fault=None if vehicle.fault is None else vehicle.fault.reason,
        fault_kind=None if vehicle.fault is None else vehicle.fault.kind.value,
        fault_code=None if vehicle.fault is None else vehicle.fault.code,
        excluded=vehicle.orders.excluded,
        loss=LossView(not outlook.uncovered, outlook.uncovered, round(now_s - outlook.at_s, 1), _list_uncovered(state))
        if known and outlook is not None
        else None,
        lands_in_s=None if board is None else round(legs.time_to_reach_s(vehicle, len(board.legs) - 1), 0),
        gps_fix=None if vehicle.sensors.gps is None else vehicle.sensors.gps.fix,
        satellites=None if vehicle.sensors.gps is None else vehicle.sensors.gps.satellites,
        voltage_v=vehicle.power.volts.voltage_v,
        wind=vehicle.sensors.wind,
        taken=_build_taken_view(context, vehicle, now_s),
        offered=state.crew.offer is not None and vehicle.name in state.crew.offer.vehicles,
        turn=_build_turn_view(context, state, vehicle, now_s),
    )


def _build_turn_view(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> TurnView | None:
    turn = vehicle.turn
    if context.day is None and not turn.swaps and turn.asked_s is None:
        return None
    on_base = vehicle.is_on_base
    base, closed = landing_base_of(context, vehicle), is_at_closed_base(context, state, vehicle)
    under_way = bool(turn.sorties) and turn.sorties[-1].ended_s is None and not on_base
    sortie = len(turn.sorties) + (not under_way)
    stock = pack_count.count_packs(context, state, vehicle.name, now_s)
    packs = None if stock is None else stock.charged
    if turn.asked_s is not None:
        text = "is looked at" if turn.ready_s is None else "waits for its sortie"
        return TurnView(turn.label, sortie, False, text, base, closed, packs)
    text = turnaround.describe_awaited_sortie(context, state, vehicle, now_s)
    return TurnView(turn.label, sortie, bool(text) and not closed, text, base, closed, packs)


def _build_taken_view(context: Context, vehicle: VehicleState, now_s: float) -> TakenView | None:
    hold = vehicle.custody.taken
    if hold is None:
        return None
    kept_s = 0.0 if hold.given_away else max(0.0, context.pilot_grace_s - (now_s - hold.since_s))
    return TakenView(round(hold.since_s, 2), round(kept_s, 0), hold.returned_s is not None)


def vehicle_state_word(context: Context, vehicle: VehicleState) -> str:
    """Return a vehicle's activity in one word; holding once its HEARTBEAT shows it."""
    if vehicle.stage is Stage.FLYING and vehicle.orders.held_s is not None and is_holding(context, vehicle):
        return "holding"
    if vehicle.stage is Stage.RETURNING and vehicle.orders.lands:
        return "landing"
    return vehicle.stage.value


def position_view(context: Context, vehicle: VehicleState, now_s: float) -> PositionView | None:
    """Return a vehicle's position and its source; None if unknown."""
    fix, how = vehicle.motion.fix, accuracy_of(vehicle)
    if fix is None or how is None:
        return None
    (east_m_s, north_m_s, _), heading_deg = fix.velocity_m_s, fix.heading_deg
    if heading_deg is None and math.hypot(east_m_s, north_m_s) > MOVING_M_S:
        heading_deg = math.degrees(math.atan2(east_m_s, north_m_s)) % 360.0
    off_m, last_off_m = None if how.known == "unsaid" else how.off_m, vehicle.sensors.positioning.accuracy_m
    last = vehicle.sensors.positioning.fixed if fix.reckoned else None
    return PositionView(
        *_list_place(context, fix, off_m, now_s),
        None if off_m is None else round(off_m, 1),
        None if heading_deg is None else round(heading_deg, 0),
        how.known,
        None if last is None else PlaceView(*_list_place(context, last, last_off_m, now_s), last_off_m),
    )


def _list_place(
    context: Context, fix: PositionFix, off_m: float | None, now_s: float
) -> tuple[float, float, float, float, float]:
    """Return latitude, longitude, height, ground speed and age of a position, as displayed."""
    lat_deg, lon_deg = context.frame.to_wgs84_deg(*fix.place_m)
    decimals, speed_m_s = formatting.place_decimals(off_m), math.hypot(*fix.velocity_m_s[:2])
    place = round(lat_deg, decimals), round(lon_deg, decimals), round(fix.alt_rel_m, 1)
    return *place, round(speed_m_s, 1), round(max(0.0, now_s - fix.at_s), 1)


def _build_battery_view(context: Context, vehicle: VehicleState) -> BatteryView:
    setup = current_setup_of(context, vehicle)
    ahead = legs.project_landing(context, vehicle, setup) if vehicle.airborne else None
    predicted_pct = band_pct = None
    # Before launch the core receives no battery reports; the first one dates from the first seconds after.
    began_pct = vehicle.power.battery.first_pct if vehicle.power.began_pct is None else vehicle.power.began_pct
    board = vehicle.assignment.board
    if board is not None and began_pct is not None and vehicle.airborne:
        ahead_pct = legs.energy_to_reach_pct(vehicle, len(board.legs) - 1)
        spent_pct = sum(leg.energy_pct for leg in board.legs) - ahead_pct
        predicted_pct = round(began_pct - setup.prior.factor * spent_pct, 1)
        band_pct = round(BAND_SD * math.hypot(setup.prior.sd * spent_pct, WHOLE_PCT), 1)
    return BatteryView(
        measured_pct=vehicle.power.battery.remaining_pct,
        predicted_pct=predicted_pct,
        predicted_band_pct=band_pct,
        to_finish_pct=round(_energy_to_finish_pct(context, vehicle), 1),
        landing_pct=None if ahead is None else round(ahead.mean_pct, 1),
        landing_band_pct=None if ahead is None else round(ahead.band_pct, 1),
        reserve_pct=setup.reserve_pct,
    )


def _energy_to_finish_pct(context: Context, vehicle: VehicleState) -> float:
    """Return the energy still needed for the mission, or for the RTL."""
    if vehicle.stage in {Stage.STARTING, Stage.FLYING}:
        return legs.energy_to_finish_pct(vehicle) if vehicle.airborne else 0.0
    if vehicle.stage is not Stage.RETURNING:
        return 0.0
    return legs.energy_to_return_pct(context, vehicle, context.vehicles[vehicle.name]) or 0.0


def _build_progress_view(context: Context, vehicle: VehicleState) -> ProgressView:
    board, leg = vehicle.assignment.board, vehicle.leg
    if board is None:
        return ProgressView(0, 0)
    total = len(board.visits)
    if not vehicle.airborne:
        done = 0 if vehicle.stage in {Stage.GROUND, Stage.STARTING} else total - len(vehicle.remaining_visits())
        return ProgressView(done, total)
    done = total - len(vehicle.remaining_visits())
    if vehicle.stage is Stage.RETURNING:
        return ProgressView(done, total, phase=(Phase.LAND if vehicle.orders.lands else Phase.RETURN).value)
    if leg is None or leg.visit is None:
        return ProgressView(done, total, phase=None if leg is None else leg.phase.value)
    track = board.tracks[leg.visit]
    share, fix = 0.0, vehicle.motion.fix
    if leg.phase is Phase.INSPECT and fix is not None and track.length_m > 0.0:
        share = round(min(1.0, max(0.0, track.locate(fix.place_m)[0] / track.length_m)), 3)
    return ProgressView(done, total, track.segment, context.segment_name(track.segment), leg.phase.value, share)
