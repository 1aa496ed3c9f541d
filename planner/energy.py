"""Pen-and-paper model of a multicopter's power (Bauersfeld, Scaramuzza, RA-L 7(2) 2022, arXiv 2109.04741).

The model gives three points - hover, best endurance, best range - from data sheet figures. A quartic through them (own
addition) gives the power at every speed between, and a cubic, as for drag, beyond. Equation numbers are those of the
paper.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from planner.errors import InstanceError

GRAVITY_M_S2 = 9.81
AIR_DENSITY_KG_M3 = 1.225
ENDURANCE_POWER_RATIO = 0.914
"""Power at best-endurance speed over hover power, eq. (17)."""
RANGE_POWER_RATIO = 1.092
"""Power at best-range speed over hover power, eq. (17)."""
ENDURANCE_SPEED = (0.10188, 0.071358, 0.0007381)
"""c0, c1, c2 of eq. (18) for the best-endurance speed."""
RANGE_SPEED = (0.041546, 0.041122, 0.00053292)
"""c0, c1, c2 of eq. (18) for the best-range speed."""
QUARTIC_ENDS = 1.25
"""Multiple of the best-range speed where the quartic, which may fall again, ends; a cubic continues with its slope."""
CLIMB_SHARE_PER_M_S = 0.04
"""Additional power per m/s of climb: 31.4 A against 28.5 A at 2.5 m/s in a recorded ArduPilot flight."""
CAPACITY_ENDS = 300.0
"""Limit in W per Ah and cell: beyond it, eq. (21) would rise again."""
LEAST_SHARE = 0.5
MOST_M_S, SPEED_STEP_M_S = 100.0, 0.1
CAPACITY = (0.9876, -0.0020, -5.2484e-5, 1.2230e-7)
"""Eq. (21) in ascending powers of W per Ah and cell; only 0.9876 matches the printed example (a public code:
0.99876)."""


@dataclass(frozen=True, slots=True)
class Drone:
    """The data sheet figures of a multicopter that the model needs."""

    name: str
    mass_kg: float
    """Take-off mass, battery included."""
    rotors: int
    propeller_radius_m: float
    cells: int
    """Cells in series."""
    capacity_ah: float
    """Capacity of the whole pack, parallel strings together."""
    area_m2: float
    """Area projected from above."""
    efficiency: float = 0.4065
    """Propeller times motor. The paper's 0.6 * 0.75 gives 11 % too little power for its own printed example."""
    cell_voltage_v: float = 3.7

    def __post_init__(self) -> None:
        """Check that every figure is a positive number.

        Raises:
            InstanceError: a figure is zero, negative, infinite or NaN.
        """
        for field in ("mass_kg", "rotors", "propeller_radius_m", "cells", "capacity_ah", "area_m2", "efficiency",
                      "cell_voltage_v"):  # fmt: skip
            number = getattr(self, field)
            if not (math.isfinite(number) and number > 0):
                raise InstanceError(f"drone {self.name!r}: {field} is {number}, expected a positive number")


PRESETS: Mapping[str, Drone] = MappingProxyType({
    "mavic2": Drone("Mavic 2", 0.91, 4, 0.110, 4, 3.9, 0.0200),
    "mavic3": Drone("Mavic 3", 0.90, 4, 0.119, 4, 5.0, 0.0215),
    "matrice200": Drone("Matrice 200", 6.14, 4, 0.216, 6, 15.3, 0.1700),
    "matrice600": Drone("Matrice 600 Pro", 15.5, 6, 0.267, 6, 34.2, 0.1760),
    "anafi-ai": Drone("Anafi AI", 0.90, 4, 0.057, 4, 6.8, 0.0400),
    "skydio2": Drone("Skydio 2", 0.78, 4, 0.085, 3, 4.3, 0.0268),
})  # fmt: skip
"""The drones of the paper's table, with its figures."""


def induced_velocity_m_s(drone: Drone) -> float:
    """Return the induced velocity in hover, eq. (4)."""
    disc_m2 = math.pi * drone.propeller_radius_m**2 * drone.rotors
    return math.sqrt(drone.mass_kg * GRAVITY_M_S2 / (2 * AIR_DENSITY_KG_M3 * disc_m2))


def hover_power_w(drone: Drone) -> float:
    """Return the electric power in hover, eq. (5) and (6)."""
    return drone.mass_kg * GRAVITY_M_S2 * induced_velocity_m_s(drone) / drone.efficiency


def endurance_speed_m_s(drone: Drone) -> float:
    """Return the speed of maximum flight time, eq. (18)."""
    return _optimal_speed_m_s(drone, ENDURANCE_SPEED)


def range_speed_m_s(drone: Drone) -> float:
    """Return the speed of maximum range, eq. (18)."""
    return _optimal_speed_m_s(drone, RANGE_SPEED)


def power_w(drone: Drone, speed_m_s: float) -> float:
    """Return the electric power in level flight through still air.

    The quartic has P(0) = P_hover, its minimum of 0.914 P_hover at the best-endurance speed, and 1.092 P_hover at the
    best-range speed, with the tangent through the origin that defines best range. Beyond 1.25 times that speed power
    grows with the cube of the speed, from the quartic's power and slope there.

    Raises:
        InstanceError: the speed is negative or not a number.
    """
    if not (math.isfinite(speed_m_s) and speed_m_s >= 0):
        raise InstanceError(f"speed is {speed_m_s} m/s, expected zero or more")
    end_m_s = QUARTIC_ENDS * range_speed_m_s(drone)
    quartic_m_s = min(speed_m_s, end_m_s)
    ratio = 1.0
    for exponent, coefficient in enumerate(_power_coefficients(drone), start=1):
        ratio += coefficient * quartic_m_s**exponent
    if speed_m_s > end_m_s:
        slope = sum(
            exponent * coefficient * end_m_s ** (exponent - 1)
            for exponent, coefficient in enumerate(_power_coefficients(drone), start=1)
        )
        ratio += slope * (speed_m_s**3 - end_m_s**3) / (3 * end_m_s**2)
    return hover_power_w(drone) * ratio


def usable_wh(drone: Drone, power_w: float) -> float:
    """Return the energy of a full battery at a steady electric power: a high load reduces it, eq. (21).

    Raises:
        InstanceError: the power exceeds the maximum of the pack.
    """
    share = _capacity_share(drone, power_w)
    if share <= 0 or power_w > CAPACITY_ENDS * drone.cells * drone.capacity_ah:
        raise InstanceError(f"drone {drone.name!r}: {power_w:.0f} W is more than its battery can give")
    return share * drone.capacity_ah * drone.cell_voltage_v * drone.cells


def _capacity_share(drone: Drone, power_w: float) -> float:
    cell_w_per_ah = power_w / (drone.cells * drone.capacity_ah)
    return sum(coefficient * cell_w_per_ah**exponent for exponent, coefficient in enumerate(CAPACITY))


def endurance_s(drone: Drone, speed_m_s: float) -> float:
    """Return the endurance of a full battery at a speed, eq. (22)."""
    power = power_w(drone, speed_m_s)
    return 3600 * usable_wh(drone, power) / power


def pct_per_s(drone: Drone, speed_m_s: float) -> float:
    """Return the energy of a second of level flight, in percent of a full battery.

    Raises:
        InstanceError: the power at this speed exceeds the battery's maximum.
    """
    return 100 / endurance_s(drone, speed_m_s)


@lru_cache(maxsize=64)
def top_speed_m_s(drone: Drone) -> float:
    """Return the highest speed, in steps of 0.1 m/s, at which the battery still delivers half of its capacity.

    At a higher load a pack delivers less than half of its charge, which is not practical.
    """
    speed_m_s = 0.0
    while speed_m_s < MOST_M_S and _capacity_share(drone, power_w(drone, speed_m_s + SPEED_STEP_M_S)) >= LEAST_SHARE:
        speed_m_s += SPEED_STEP_M_S
    return round(speed_m_s, 1)


def _optimal_speed_m_s(drone: Drone, coefficients: tuple[float, float, float]) -> float:
    constant, per_m_s, per_cm2 = coefficients
    induced = induced_velocity_m_s(drone)
    return induced / (constant + per_m_s * induced + per_cm2 * drone.area_m2 * 1e4)


@lru_cache(maxsize=64)
def _power_coefficients(drone: Drone) -> tuple[float, ...]:
    """Return the coefficients of v, v^2, v^3, v^4 in P(v) / P_hover."""
    slow, fast = endurance_speed_m_s(drone), range_speed_m_s(drone)
    exponents = np.arange(1, 5)
    conditions = np.array([
        slow**exponents,
        exponents * slow ** (exponents - 1),
        fast**exponents,
        exponents * fast ** (exponents - 1),
    ])  # fmt: skip
    wanted = np.array([ENDURANCE_POWER_RATIO - 1, 0.0, RANGE_POWER_RATIO - 1, RANGE_POWER_RATIO / fast])
    return tuple(float(coefficient) for coefficient in np.linalg.solve(conditions, wanted))
