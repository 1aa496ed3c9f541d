"""Hold the constants of a flight: site, network and rules, as the decisions need them."""

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
    """Whether vehicles on the ground take off for a re-plan."""

    ASK = "ask"
    """Once the crew has reported the pad clear."""
    NEVER = "never"
    """Not after a landing, unless the crew includes the vehicle."""
    AUTO = "auto"
    """Automatically, for simulation."""


@dataclass(frozen=True, slots=True)
class FenceRules:
    """The site's rules for fences and rally points."""

    enabled: bool
    """Whether to upload fences; otherwise those on board are only read."""
    margin_m: float
    height_margin_m: float
    action: str
    """Action at a breach: keep, warn, hold, return or land."""
    rally: str
    """Rally points: keep those on board, or only the vehicle's own pad."""


@dataclass(frozen=True, slots=True)
class VehicleSetup:
    """The setup of one vehicle."""

    name: str
    sysid: int
    dialect: Dialect
    budget_pct: float
    reserve_pct: float
    link_timeout_s: float
    """Silence until it is declared lost: at least the time in which its own failsafe acts."""
    pad_m: tuple[float, float]
    """Its start, local east and north: its home."""
    failsafe_s: float | None = None
    """Silence of ours after which its failsafe ends the mission; None if it has none, or did not report it."""
    returns: bool = False
    """Whether that failsafe climbs to the RTL height and returns; no other one leaves the line."""
    holds_s: float = 0.0
    """Hold before its own failsafe acts, if reported."""
    planned: bool = True
    """Whether its plan is known; otherwise its landing place and its stops show nothing."""
    prior: Prior = NO_PRIOR
    """Prior consumption relative to the energy model."""
    pack: PackFacts = NO_FACTS
    """The pack's figures from the site file and earlier flights."""
    history: PackHistory | None = None
    """The history of the pack, where the site names it."""
    radio: RadioShare = ALONE
    """Its share of its radio."""
    empty_pct: float = 0.0
    """Percentage reported with an empty pack, by its earlier flights; part of `reserve_pct`."""
    start: LearnedFactors = UNKNOWN
    """Its learned pace relative to its model, before this flight."""
    packs: Mapping[str, VehicleSetup] = field(default_factory=dict)
    """The same vehicle with each other pack of the site, by label; under "" with an unknown one."""
    day_pads_m: tuple[tuple[float, float], ...] = ()
    """Its pads at the bases of the day, where its sorties end at more than one."""
    rallies: bool = False
    """Whether these are its rally points: RTL then ends at the nearest, otherwise at its take-off place."""

    def pad_distance_m(self, place_m: tuple[float, float]) -> float:
        """Return the distance of a place to the nearest of its pads; it may land on any."""
        return min(math.dist(place_m, pad_m) for pad_m in (self.pad_m, *self.day_pads_m))

    def with_pack(self, label: str) -> VehicleSetup:
        """Return the setup with the pack that the crew has inserted."""
        return self.packs.get(label, self.packs.get("", self))


@dataclass(frozen=True, slots=True)
class Scene:
    """The figures needed to watch vehicles, of our flight or not, with or without a plan."""

    frame: LocalFrame
    """Local metres around the depot."""
    vehicles: Mapping[str, VehicleSetup]
    limits: Limits
    drone: Drone
    draws_pct_s: tuple[float, ...]
    """From the drone's `draws_pct_s`."""
    wind_m_s: tuple[float, float]
    """Wind velocity, east and north, from the site file."""
    corridor_m: float
    inspection_speed_m_s: float

    def draw_pct_per_s(self, east_m_s: float, north_m_s: float) -> float:
        """Return the modelled power draw at a ground velocity in the site's wind."""
        speed_m_s = math.hypot(east_m_s - self.wind_m_s[0], north_m_s - self.wind_m_s[1])
        return self.draws_pct_s[min(round(10 * speed_m_s), len(self.draws_pct_s) - 1)]

    def model_of(self, setup: VehicleSetup) -> tuple[Performance, Pace]:
        """Return a vehicle's performance and pace; here its autopilot's defaults."""
        return setup.dialect.performance, AS_MODELLED

    def return_height_m(self, name: str) -> float:  # noqa: ARG002 - a context with a plan overrides it
        """Return the RTL height over the vehicle's own home; 0 if unknown."""
        return 0.0


@cache
def power_draw_table_pct_s(drone: Drone) -> tuple[float, ...]:
    """Return the power draw at 0, 0.1, 0.2 ... m/s, up to the battery's limit.

    Every position and battery evaluation uses it; a step changes the figure by less than 1 %.
    """
    return tuple(pct_per_s(drone, step / 10) for step in range(round(10 * top_speed_m_s(drone)) + 1))


@dataclass(frozen=True, slots=True)
class PackRules:
    """The packs of a base."""

    count: int
    """Charged at the start of the day."""
    recharge_s: float | None = None
    """Time from a landing until the pack is charged; None if packs are charged only overnight."""


@dataclass(frozen=True, slots=True)
class DayRules:
    """Rules of a day's plan beside its sorties; all times count from launch."""

    stagger_s: float
    """Shortest time between two take-offs from a base."""
    bases: Mapping[str, str]
    """The base of each vehicle."""
    windows_s: Mapping[str, tuple[tuple[float, float], ...]]
    """Hours of each vehicle."""
    barred: Mapping[str, frozenset[int]] = field(default_factory=dict)
    """By vehicle: the segments its camera cannot inspect."""
    packs: Mapping[str, PackRules] = field(default_factory=dict)
    """By base; without those that always have enough."""
    pads: Mapping[str, Mapping[str, Pad]] = field(default_factory=dict)
    """By vehicle and base, for vehicles whose sorties do not all end where they begin."""

    @property
    def ends_s(self) -> float:
        """End of the last vehicle's hours."""
        return max((window[1] for own in self.windows_s.values() for window in own), default=0.0)


@dataclass(frozen=True, slots=True)
class Context(Scene):
    """All inputs of `fleet_step.step` besides the state and the event."""

    setup: FlightSetup
    pricing: Pricing
    """Times and energies of all moves, with the measured pads."""
    wanted: frozenset[int]
    """The segments of this flight: those of its first plan."""
    unreachable: tuple[Unreachable, ...]
    """Requested segments that no flight can inspect."""
    fly_again: RelaunchPolicy
    pilot_grace_s: float
    """Time for which the segments of a vehicle that its pilot has taken are reserved for it."""
    pilot_returns: bool
    """Whether a vehicle that its pilot has returned to its mission rejoins the plan at once."""
    infers: bool
    """Whether unobserved parts of a mission count if all evidence fits; otherwise they are flown again."""
    offer_s: float
    """Time for which an offer of another take-off is open once no vehicle is in the air."""
    horizon_s: float
    """Time allowed for solving and uploading a re-plan, in the vehicles' time."""
    fencing: FenceRules | None = None
    """None if the site has no rules for fences."""
    camera_home: bool = True
    """Whether a vehicle returns when its camera or gimbal fails; otherwise it continues with what it can see."""
    day: DayRules | None = None
    """The rules of a day of several sorties; None for a single flight."""

    @property
    def segments(self) -> int:
        """Number of requested segments, those that cannot be inspected included."""
        return len(self.wanted) + len(self.unreachable)

    def segment_name(self, segment: int) -> str:
        """Return the name of a segment's asset."""
        return self.setup.network.segment_name(segment)

    def model_of(self, setup: VehicleSetup) -> tuple[Performance, Pace]:
        """Return a vehicle's performance and pace, by its parameters and earlier flights."""
        model = self.pricing.models[setup.name]
        return model.performance, model.pace

    def return_height_m(self, name: str) -> float:
        """Return the RTL height over the vehicle's own home."""
        return self.setup.return_height_m(name)
