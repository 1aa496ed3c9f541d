"""Faults of simulated vehicles: kinds, notation, and triggers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import Enum

from simulator.errors import FaultSpecError

ALL_VEHICLES = "all"
DOWN = "-down"
LANDED = "landed"


class InjectionKind(Enum):
    """Kinds of faults."""

    SILENT = "silent"
    """The link is dead in both directions, permanently or for VALUE seconds; the vehicle flies on."""
    BATTERY_STEP = "battery-step"
    """VALUE points of charge are lost at once."""
    DRAIN = "drain"
    """The battery drains VALUE times as fast."""
    CRASH = "crash"
    """The motors stop."""
    WEAK = "weak"
    """Its motors lose a share VALUE of their thrust: from half on it sinks, in its current mode."""
    REBOOT = "reboot"
    """The autopilot restarts: on the ground it is back after a few seconds, in the air it falls; with ``pad`` it is
    back on its pad from any position, like a restarted simulator."""
    REFUSE_UPLOAD = "refuse-upload"
    """Every further mission is refused."""
    HALF_UPLOAD = "half-upload"
    """The vehicle stops requesting after half of the items."""
    LOSS = "loss"
    """A share VALUE of the datagrams is lost, each way."""
    DELAY = "delay"
    """Every datagram takes VALUE seconds, each way."""
    DUPLICATE = "duplicate"
    """A share VALUE of the datagrams is duplicated."""
    REORDER = "reorder"
    """A share VALUE of the datagrams arrives out of order."""
    RATE = "rate"
    """VALUE bytes a second pass in each direction, as over a radio; the rest is queued, and lost when the queue is
    full."""
    PILOT = "pilot"
    """A pilot switches to mode VALUE by remote control and holds the sticks from then on."""
    STICKS = "sticks"
    """A pilot moves the sticks: PX4 switches to manual, ArduPilot on its mission does not."""
    STATION = "station"
    """Another ground station, system 254 (253 if that is ours), appears and commands mode VALUE."""
    KILL = "kill"
    """A pilot's kill switch: the motors stop at once, and it disarms in any state."""
    DISARM = "disarm"
    """A pilot disarms it, which autopilots refuse in the air."""
    WRECK = "wreck"
    """It falls, and lies on its back with its motors on: armed, in its last mode, and still transmitting."""
    FENCE = "fence"
    """It is outside its fence, and returns."""
    EMERGENCY = "emergency"
    """Its battery falls to a few percent, and its own failsafe acts: LAND, or VALUE."""
    EKF = "ekf"
    """Its position estimate fails, and it lands."""
    GPS = "gps"
    """Its GPS loses its fix, permanently or for VALUE seconds; it dead-reckons, and its failsafe lands it."""
    CAMERA_SILENT = "camera-silent"
    """Its cameras take no pictures and send nothing."""
    CAMERA_MUTE = "camera-mute"
    """Its cameras take pictures without reporting them."""
    CAMERA_LOSS = "camera-loss"
    """A share VALUE of its cameras' reports is lost."""
    CARD_FULL = "card-full"
    """The memory cards of its cameras are full."""
    GIMBAL_STUCK = "gimbal-stuck"
    """Its gimbal does not move."""
    PACK = "pack"
    """A person swaps the pack of a vehicle with stopped motors: it loses power for a while, and restarts with VALUE
    percent, or full."""


PAYLOAD_FAULTS = frozenset({
    InjectionKind.CAMERA_SILENT, InjectionKind.CAMERA_MUTE, InjectionKind.CAMERA_LOSS, InjectionKind.CARD_FULL,
    InjectionKind.GIMBAL_STUCK,
})  # fmt: skip

LINK_FIELDS: Mapping[InjectionKind, str] = {
    InjectionKind.LOSS: "loss", InjectionKind.DELAY: "delay_s", InjectionKind.DUPLICATE: "duplicate",
    InjectionKind.REORDER: "reorder", InjectionKind.RATE: "rate_bytes_s",
}  # fmt: skip
"""Link condition that each link fault changes."""
LINK_FAULTS = frozenset({InjectionKind.SILENT, *LINK_FIELDS})


@dataclass(frozen=True, slots=True)
class _Rule:
    """Allowed value after the kind's equals sign."""

    expected: str
    """Expected value, for the error line."""
    low: float = 0.0
    high: float = math.inf
    required: bool = True
    seconds: bool = False
    """Whether the number may carry an ``s``."""
    words: frozenset[str] = frozenset()
    """Allowed words, if the value is a word."""


PILOT_MODES: Mapping[str, frozenset[str]] = {
    "ardupilot": frozenset({"AUTO", "LOITER", "ALT_HOLD", "STABILIZE", "POSHOLD", "BRAKE", "RTL", "LAND"}),
    "px4": frozenset({"MISSION", "POSCTL", "ALTCTL", "HOLD", "RTL", "LAND"}),
}
"""Modes that a pilot may select, by autopilot."""


_WORDS = frozenset().union(*PILOT_MODES.values())
_MODE = _Rule(f"a mode: one of {', '.join(sorted(_WORDS))}", words=_WORDS)
_SHARE = _Rule("a share from 0 to 1", high=1.0)
_RULES: dict[InjectionKind, _Rule] = {
    InjectionKind.SILENT: _Rule("seconds, such as 20s, or nothing for good", required=False, seconds=True),
    InjectionKind.BATTERY_STEP: _Rule("points of charge from 0 to 100", high=100.0),
    InjectionKind.DRAIN: _Rule("a factor of 0 or more"),
    InjectionKind.REBOOT: _Rule("pad, or nothing", required=False, words=frozenset({"pad"})),
    InjectionKind.WEAK: _SHARE,
    InjectionKind.LOSS: _SHARE,
    InjectionKind.DELAY: _Rule("seconds", seconds=True),
    InjectionKind.DUPLICATE: _SHARE,
    InjectionKind.REORDER: _SHARE,
    InjectionKind.RATE: _Rule("bytes a second from 1", low=1.0),
    InjectionKind.PILOT: _MODE,
    InjectionKind.STATION: _MODE,
    InjectionKind.EMERGENCY: _Rule("LAND or RTL, or nothing", required=False, words=frozenset({"LAND", "RTL"})),
    InjectionKind.CAMERA_LOSS: _SHARE,
    InjectionKind.GPS: _Rule("seconds, such as 20s, or nothing for good", required=False, seconds=True),
    InjectionKind.PACK: _Rule("percent that it holds, above 0 to 100, or nothing", 1.0, 100.0, required=False),
}
"""Rules for values; a kind without one takes none."""


@dataclass(frozen=True, slots=True)
class Injection:
    """One fault of one vehicle, or of all; exactly one of ``after_s``, ``share`` and ``height_m`` is given."""

    vehicle: str
    """A vehicle's name, or ``all``."""
    kind: InjectionKind
    value: float | None = None
    after_s: float | None = None
    """Trigger: simulated seconds after the mission start; 0 is from the very start."""
    share: float | None = None
    """Trigger: share of the initial mission's length, 0 to 1."""
    height_m: float | None = None
    """Trigger: height above its pad, climbing or descending."""
    down: bool = False
    """Whether the height counts while descending."""
    landings: int | None = None
    """Trigger: number of landings."""
    word: str = ""
    """Word after the equals sign."""
    link: int = 0
    """For a link fault: link number from 1; 0 is all links."""

    @property
    def spec(self) -> str:
        """The fault in the grammar that ``parse_fault`` reads."""
        unit = "s" if self.kind in {InjectionKind.SILENT, InjectionKind.GPS} else ""
        value = f"={self.word}" if self.word else "" if self.value is None else f"={self.value:g}{unit}"
        vehicle = f"{self.vehicle}.{self.link}" if self.link else self.vehicle
        return f"{vehicle}:{self.kind.value}{value}@{self._when}"

    @property
    def _when(self) -> str:
        if self.after_s is not None:
            return f"{self.after_s:g}s"
        if self.height_m is not None:
            return f"{self.height_m:g}m{DOWN if self.down else ''}"
        if self.landings is not None:
            return f"{LANDED}{self.landings if self.landings > 1 else ''}"
        return f"{100 * (self.share or 0.0):g}%"


def parse_fault(text: str) -> Injection:
    """Read ``VEHICLE[.LINK]:KIND[=VALUE]@WHEN``.

    LINK selects one of several links, from 1, for a link fault.

    WHEN is ``300s``, ``40%``, ``2.5m`` while climbing, ``20m-down``, or ``landed``, and ``landed2`` after its second
    landing.

    Raises:
        FaultSpecError: one line that quotes the text and says what was expected.

    >>> parse_fault("uav2:silent=20s@300s")
    Injection(vehicle='uav2', kind=<InjectionKind.SILENT: 'silent'>, value=20.0, after_s=300.0, share=None, \
height_m=None, down=False, landings=None, word='', link=0)
    """
    head, at, when = text.strip().rpartition("@")
    vehicle, colon, what = head.partition(":")
    if not (at and colon and vehicle.strip()):
        raise FaultSpecError(f"fault {text!r}: expected VEHICLE:KIND[=VALUE]@WHEN, such as uav2:silent@40%")
    name, equals, raw = what.partition("=")
    try:
        kind = InjectionKind(name.strip())
    except ValueError:
        kinds = ", ".join(kind.value for kind in InjectionKind)
        raise FaultSpecError(f"fault {text!r}: unknown kind {name.strip()!r}, expected one of {kinds}") from None
    value = _parse_value(text, kind, raw.strip() if equals else None)
    number, word = (None, value) if isinstance(value, str) else (value, "")
    name, dot, link = vehicle.strip().partition(".")
    if dot and (kind not in LINK_FAULTS or not link.isdecimal() or int(link) < 1):
        raise FaultSpecError(f"fault {text!r}: expected VEHICLE.LINK, a number from 1, for faults of links only")
    return _parse_when(text, when.strip(), Injection(name, kind, number, word=word, link=int(link or 0)))


def _parse_value(text: str, kind: InjectionKind, raw: str | None) -> float | str | None:
    rule = _RULES.get(kind)
    if rule is None:
        if raw is not None:
            raise FaultSpecError(f"fault {text!r}: {kind.value} takes no value")
        return None
    if raw is None:
        if rule.required:
            raise FaultSpecError(f"fault {text!r}: {kind.value} needs a value, expected {rule.expected}")
        return None
    if raw in rule.words:
        return raw
    value = None if rule.words else _number(raw.removesuffix("s") if rule.seconds else raw)
    if value is None or not rule.low <= value <= rule.high:
        raise FaultSpecError(f"fault {text!r}: {kind.value} has {raw!r}, expected {rule.expected}")
    return value


def _parse_when(text: str, when: str, fault: Injection) -> Injection:
    """Return the fault with its trigger: seconds after mission start, a share of the route, or a height."""
    count = when.removeprefix(LANDED) or "1"
    if when.startswith(LANDED) and count.isdecimal() and int(count) > 0:
        return replace(fault, landings=int(count))
    value = _number(when.removesuffix(DOWN)[:-1])
    if value is not None and value >= 0:
        if when.endswith("s"):
            return replace(fault, after_s=value)
        if when.endswith("%") and value <= 100:
            return replace(fault, share=value / 100)
        if when.removesuffix(DOWN).endswith("m"):
            return replace(fault, height_m=value, down=when.endswith(DOWN))
    raise FaultSpecError(
        f"fault {text!r}: WHEN is {when!r}, expected seconds such as 300s or a share such as 40%, a height on the way "
        f"up such as 2.5m or on the way down such as 20m{DOWN}, or {LANDED}"
    )


def _number(raw: str) -> float | None:
    try:
        value = float(raw)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def check_modes(fault: Injection, vehicle: str, autopilot: str) -> None:
    """Refuse a mode that a vehicle does not have.

    Raises:
        FaultSpecError: lists the vehicle's modes.
    """
    if fault.kind not in {InjectionKind.PILOT, InjectionKind.STATION} or fault.vehicle not in {vehicle, ALL_VEHICLES}:
        return
    modes = PILOT_MODES[autopilot]
    if fault.word not in modes:
        known = ", ".join(sorted(modes))
        raise FaultSpecError(f"fault {fault.spec!r}: {vehicle} has no mode {fault.word}, expected one of {known}")


def faults_of(faults: Iterable[Injection], vehicle: str) -> tuple[Injection, ...]:
    """Return the faults that apply to ``vehicle``."""
    return tuple(fault for fault in faults if fault.vehicle in {ALL_VEHICLES, vehicle})


def is_due(
    fault: Injection,
    mission_s: float | None,
    flown_share: float | None,
    up_m: float = 0.0,
    highest_m: float = 0.0,
    landings: int = 0,
) -> bool:
    """Return whether the fault is due.

    Args:
        fault: the fault.
        mission_s: simulated seconds since the vehicle began its mission; None before.
        flown_share: distance flown since then over the length of that mission; None before.
        up_m: height above its pad.
        highest_m: maximum height so far.
        landings: number of landings.
    """
    if fault.landings is not None:
        return landings >= fault.landings
    if fault.height_m is not None:
        return highest_m >= fault.height_m and (up_m <= fault.height_m or not fault.down)
    if fault.after_s == 0:
        return True
    if fault.after_s is not None:
        return mission_s is not None and mission_s >= fault.after_s
    return flown_share is not None and flown_share >= (fault.share or 0.0)
