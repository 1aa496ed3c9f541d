"""What does not change during a flight: the site, the network and the rules, as the decisions need them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cache

from executor.core.battery.account import NO_PRIOR
from executor.core.battery.kalman import Prior
from executor.core.battery.pack_condition import PackHistory
from executor.core.battery.voltage import NO_FACTS, PackFacts
from executor.core.fault_thresholds import Limits
from executor.core.radio_budget import ALONE, RadioShare
from executor.core.vehicle_learning import UNKNOWN, LearnedFactors
from missions import Dialect, FlightSetup, LocalFrame, Pace, Pad, Performance, Pricing
from missions.flight_model import AS_MODELLED
from missions.no_fly_areas import Unreachable
from planner import Drone, pct_per_s, top_speed_m_s


class RelaunchPolicy(Enum):
    """Whether a vehicle on the ground takes off for a re-plan."""

    ASK = "ask"
    """When the crew has said that its pad is clear."""
    NEVER = "never"
    """Not one that has landed, unless the crew includes it."""
    AUTO = "auto"
    """By itself: for simulation."""


@dataclass(frozen=True, slots=True)
class FenceRules:
    """What the site says of fences and rally points."""

    enabled: bool
    """Whether vehicles are given any; else what is on board is only looked at."""
    margin_m: float
    height_margin_m: float
    action: str
    """What a vehicle does at a breach: keep, warn, hold, return or land."""
    rally: str
    """Its rally points: keep those on board, or its own pad alone."""


@dataclass(frozen=True, slots=True)
class VehicleSetup:
    """What the site says of one vehicle."""

    name: str
    sysid: int
    dialect: Dialect
    budget_pct: float
    reserve_pct: float
    link_timeout_s: float
    """Silence until it is lost: at least the time in which its own failsafe acts."""
    pad_m: tuple[float, float]
    """Where it starts, local east and north: its home."""
    failsafe_s: float | None = None
    """Silence of ours after which it ends its mission by itself; None if it does not, or did not say so."""
    returns: bool = False
    """Whether it then climbs to the height of its return, and comes home: nothing else leaves the line."""
    holds_s: float = 0.0
    """How long it holds before a failsafe of its own acts, if it said so."""
    planned: bool = True
    """Whether its plan is known: without one neither where it lands nor how long it stays somewhere says anything."""
    prior: Prior = NO_PRIOR
    """What is believed of its consumption, relative to the energy model, before it has used anything."""
    pack: PackFacts = NO_FACTS
    """What the site file, and its earlier flights, say of its pack."""
    history: PackHistory | None = None
    """The pack, where the site names it."""
    radio: RadioShare = ALONE
    """What it has of the radio that it is behind."""
    empty_pct: float = 0.0
    """What its autopilot reports when its pack is empty, by its earlier flights; a part of `reserve_pct`."""
    start: LearnedFactors = UNKNOWN
    """What is known of its pace, relative to its model, before it has flown anything."""
    packs: Mapping[str, VehicleSetup] = field(default_factory=dict)
    """The same vehicle with another pack that the site knows, by its label; by "" with one that nobody knows."""
    day_pads_m: tuple[tuple[float, float], ...] = ()
    """Its pads at the bases of the day, where its sorties end at more than one."""
    rallies: bool = False
    """Whether these are its rally points: its own RTL then ends on the nearest of them, else where it took off."""

    def pad_distance_m(self, place_m: tuple[float, float]) -> float:
        """Return how far a place is from the nearest of its pads: it may land on each."""
        return min(math.dist(place_m, pad_m) for pad_m in (self.pad_m, *self.day_pads_m))

    def with_pack(self, label: str) -> VehicleSetup:
        """Return the setup for the pack that the crew has put in."""
        return self.packs.get(label, self.packs.get("", self))


@dataclass(frozen=True, slots=True)
class Scene:
    """What is needed to watch vehicles, ours or not, with a plan or without."""

    frame: LocalFrame
    """Local metres about the depot."""
    vehicles: Mapping[str, VehicleSetup]
    limits: Limits
    drone: Drone
    draws_pct_s: tuple[float, ...]
    """By `draws_pct_s` of the drone."""
    wind_m_s: tuple[float, float]
    """Where the air moves to, east and north, as the site file says."""
    corridor_m: float
    inspection_speed_m_s: float

    def draw_pct_per_s(self, east_m_s: float, north_m_s: float) -> float:
        """Return what the energy model says a velocity over ground costs in the site's wind."""
        speed_m_s = math.hypot(east_m_s - self.wind_m_s[0], north_m_s - self.wind_m_s[1])
        return self.draws_pct_s[min(round(10 * speed_m_s), len(self.draws_pct_s) - 1)]

    def model_of(self, setup: VehicleSetup) -> tuple[Performance, Pace]:
        """Return how a vehicle flies, as far as it is known: as its autopilot's defaults have it."""
        return setup.dialect.performance, AS_MODELLED

    def return_height_m(self, name: str) -> float:  # noqa: ARG002 - who has a plan knows it
        """Return the height over its own home that a vehicle climbs to before it comes home by itself; 0 is none."""
        return 0.0


@cache
def power_draw_table_pct_s(drone: Drone) -> tuple[float, ...]:
    """Return what a second costs at 0, 0.1, 0.2 ... m/s, up to what the battery can give.

    Every position and every look at the battery asks for one; a step changes the figure by less than 1 %.
    """
    return tuple(pct_per_s(drone, step / 10) for step in range(round(10 * top_speed_m_s(drone)) + 1))


@dataclass(frozen=True, slots=True)
class PackRules:
    """The packs of a base."""

    count: int
    """Charged in the morning."""
    recharge_s: float | None = None
    """From a landing until the pack is charged; None where packs are charged overnight alone."""


@dataclass(frozen=True, slots=True)
class DayRules:
    """What a day's plan says beside its sorties; all times count from the launch."""

    stagger_s: float
    """The least time between two take-offs from a base."""
    bases: Mapping[str, str]
    """Of each vehicle."""
    windows_s: Mapping[str, tuple[tuple[float, float], ...]]
    """When each vehicle may fly."""
    barred: Mapping[str, frozenset[int]] = field(default_factory=dict)
    """By the vehicle's name: the network's segments that its camera is not good for."""
    packs: Mapping[str, PackRules] = field(default_factory=dict)
    """By the base's name; one that always has enough is not among them."""
    pads: Mapping[str, Mapping[str, Pad]] = field(default_factory=dict)
    """By the vehicle's name and the base's, of the vehicles whose sorties do not all end where they begin."""

    @property
    def ends_s(self) -> float:
        """When nobody may fly any more."""
        return max((window[1] for own in self.windows_s.values() for window in own), default=0.0)


@dataclass(frozen=True, slots=True)
class Context(Scene):
    """Everything that `fleet_step.step` may look at besides the state and the event."""

    setup: FlightSetup
    pricing: Pricing
    """Times and energies of all moves, with the pads as they really are."""
    wanted: frozenset[int]
    """The network's segments that this flight is for: those of its first plan."""
    unreachable: tuple[Unreachable, ...]
    """Those that were asked for as well, and no flight can inspect."""
    fly_again: RelaunchPolicy
    pilot_grace_s: float
    """How long the segments of a vehicle that its pilot has taken are kept for it."""
    pilot_returns: bool
    """Whether a vehicle that its pilot has put back on its mission is in the plan again at once."""
    infers: bool
    """Whether what nobody saw of a mission counts where everything that is known fits; else it is flown again."""
    offer_s: float
    """How long an offer to fly again stands once nobody flies any more."""
    horizon_s: float
    """How long solving and uploading a re-plan may take, in the vehicles' time."""
    fencing: FenceRules | None = None
    """None where the site says nothing of fences."""
    camera_home: bool = True
    """Whether a vehicle whose camera or gimbal fails comes home; else it goes on with what it can see."""
    day: DayRules | None = None
    """Of a day of several sorties; None of a single flight."""

    @property
    def segments(self) -> int:
        """How many segments were asked for, those that cannot be inspected among them."""
        return len(self.wanted) + len(self.unreachable)

    def segment_name(self, segment: int) -> str:
        """Return a segment by the name of the asset, as people call it."""
        return self.setup.network.segment_name(segment)

    def model_of(self, setup: VehicleSetup) -> tuple[Performance, Pace]:
        """Return how a vehicle flies, by its own parameters and by its flights before."""
        model = self.pricing.models[setup.name]
        return model.performance, model.pace

    def return_height_m(self, name: str) -> float:
        """Return the height over its own home at which a vehicle must come home by itself, straight and level."""
        return self.setup.return_height_m(name)
