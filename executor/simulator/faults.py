"""Faults to order: ``VEHICLE:KIND[=VALUE]@WHEN`` as data, and when each of them is due."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from executor.simulator.errors import FaultSpecError

ALL_VEHICLES = "all"


class FaultKind(Enum):
    """What goes wrong."""

    SILENT = "silent"
    """The link is dead both ways, for good or for VALUE seconds; the vehicle flies on."""
    BATTERY_STEP = "battery-step"
    """VALUE points of charge are lost at once."""
    DRAIN = "drain"
    """The battery is used VALUE times as fast."""
    CRASH = "crash"
    """The motors stop."""
    REBOOT = "reboot"
    """The autopilot restarts: on the ground it is back after a few seconds, in the air it falls."""
    REFUSE_UPLOAD = "refuse-upload"
    """No mission is accepted any more."""
    HALF_UPLOAD = "half-upload"
    """The vehicle stops asking after half of the items."""
    LOSS = "loss"
    """A share VALUE of the datagrams is lost, each way."""
    DELAY = "delay"
    """Every datagram takes VALUE seconds, each way."""
    DUPLICATE = "duplicate"
    """A share VALUE of the datagrams comes twice."""
    REORDER = "reorder"
    """A share VALUE of the datagrams is overtaken by later ones."""


@dataclass(frozen=True, slots=True)
class _Rule:
    """What may stand behind the kind's equals sign."""

    expected: str
    """In words, for the error line."""
    low: float = 0.0
    high: float = math.inf
    required: bool = True
    seconds: bool = False
    """Whether the number may carry an ``s``."""


_SHARE = _Rule("a share from 0 to 1", high=1.0)
_RULES: dict[FaultKind, _Rule | None] = {
    FaultKind.SILENT: _Rule("seconds, such as 20s, or nothing for good", required=False, seconds=True),
    FaultKind.BATTERY_STEP: _Rule("points of charge from 0 to 100", high=100.0),
    FaultKind.DRAIN: _Rule("a factor of 0 or more"),
    FaultKind.CRASH: None,
    FaultKind.REBOOT: None,
    FaultKind.REFUSE_UPLOAD: None,
    FaultKind.HALF_UPLOAD: None,
    FaultKind.LOSS: _SHARE,
    FaultKind.DELAY: _Rule("seconds", seconds=True),
    FaultKind.DUPLICATE: _SHARE,
    FaultKind.REORDER: _SHARE,
}


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault of one vehicle, or of all; exactly one of ``after_s`` and ``share`` is given."""

    vehicle: str
    """A vehicle's name, or ``all``."""
    kind: FaultKind
    value: float | None = None
    after_s: float | None = None
    """Simulated seconds after the vehicle began its mission; 0 is from the beginning, before any mission."""
    share: float | None = None
    """Of the length of the mission that the vehicle began with, 0 to 1."""

    @property
    def spec(self) -> str:
        """The fault in the grammar that ``parse_fault`` reads."""
        unit = "s" if self.kind is FaultKind.SILENT else ""
        value = "" if self.value is None else f"={self.value:g}{unit}"
        when = f"{self.after_s:g}s" if self.after_s is not None else f"{100 * (self.share or 0.0):g}%"
        return f"{self.vehicle}:{self.kind.value}{value}@{when}"


def parse_fault(text: str) -> Fault:
    """Read ``VEHICLE:KIND[=VALUE]@WHEN``, WHEN being ``300s`` or ``40%``.

    Raises:
        FaultSpecError: one line that quotes the text and says what was expected.

    >>> parse_fault("uav2:silent=20s@300s")
    Fault(vehicle='uav2', kind=<FaultKind.SILENT: 'silent'>, value=20.0, after_s=300.0, share=None)
    """
    head, at, when = text.strip().rpartition("@")
    vehicle, colon, what = head.partition(":")
    if not (at and colon and vehicle.strip()):
        raise FaultSpecError(f"fault {text!r}: expected VEHICLE:KIND[=VALUE]@WHEN, such as uav2:silent@40%")
    name, equals, raw = what.partition("=")
    try:
        kind = FaultKind(name.strip())
    except ValueError:
        kinds = ", ".join(kind.value for kind in FaultKind)
        raise FaultSpecError(f"fault {text!r}: unknown kind {name.strip()!r}, expected one of {kinds}") from None
    value = _parse_value(text, kind, raw.strip() if equals else None)
    after_s, share = _parse_when(text, when.strip())
    return Fault(vehicle.strip(), kind, value, after_s, share)


def _parse_value(text: str, kind: FaultKind, raw: str | None) -> float | None:
    rule = _RULES[kind]
    if rule is None:
        if raw is not None:
            raise FaultSpecError(f"fault {text!r}: {kind.value} takes no value")
        return None
    if raw is None:
        if rule.required:
            raise FaultSpecError(f"fault {text!r}: {kind.value} needs a value, expected {rule.expected}")
        return None
    value = _number(raw.removesuffix("s") if rule.seconds else raw)
    if value is None or not rule.low <= value <= rule.high:
        raise FaultSpecError(f"fault {text!r}: {kind.value} has {raw!r}, expected {rule.expected}")
    return value


def _parse_when(text: str, when: str) -> tuple[float | None, float | None]:
    """Return seconds after the mission's start, or the share of the route; the other is None."""
    value = _number(when[:-1])
    if value is not None and value >= 0:
        if when.endswith("s"):
            return value, None
        if when.endswith("%") and value <= 100:
            return None, value / 100
    raise FaultSpecError(f"fault {text!r}: WHEN is {when!r}, expected seconds such as 300s or a share such as 40%")


def _number(raw: str) -> float | None:
    try:
        value = float(raw)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def faults_of(faults: Iterable[Fault], vehicle: str) -> tuple[Fault, ...]:
    """Return the faults that befall ``vehicle``."""
    return tuple(fault for fault in faults if fault.vehicle in {ALL_VEHICLES, vehicle})


def is_due(fault: Fault, mission_s: float | None, flown_share: float | None) -> bool:
    """Return whether the fault's time has come.

    Args:
        fault: the fault.
        mission_s: simulated seconds since the vehicle began its mission; None before.
        flown_share: distance flown since then over the length of that mission; None before.
    """
    if fault.after_s == 0:
        return True
    if fault.after_s is not None:
        return mission_s is not None and mission_s >= fault.after_s
    return flown_share is not None and flown_share >= (fault.share or 0.0)
