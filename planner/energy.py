"""The pen-and-paper model of a multicopter's power (Bauersfeld, Scaramuzza, RA-L 7(2) 2022, arXiv 2109.04741).

The model gives three points - hover, best endurance, best range - from figures that stand in a data sheet. A quartic
through them (own addition) gives the power at every speed between. Equation numbers are those of the paper.
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
"""Power at the speed of best endurance over hover power, eq. (17)."""
RANGE_POWER_RATIO = 1.092
"""Power at the speed of best range over hover power, eq. (17)."""
ENDURANCE_SPEED = (0.10188, 0.071358, 0.0007381)
"""c0, c1, c2 of eq. (18) for the speed of best endurance."""
RANGE_SPEED = (0.041546, 0.041122, 0.00053292)
"""c0, c1, c2 of eq. (18) for the speed of best range."""
CAPACITY = (0.9876, -0.0020, -5.2484e-5, 1.2230e-7)
"""Eq. (21) in ascending powers of W per Ah and cell; only 0.9876 fits the printed example (a public code: 0.99876)."""


@dataclass(frozen=True, slots=True)
class Drone:
    """What the model needs to know of a multicopter; all of it stands in the data sheet."""

    name: str
    mass_kg: float
    """Take-off mass, battery included."""
    rotors: int
    propeller_radius_m: float
    cells: int
    """Cells in series."""
    capacity_ah: float
    """Of the whole pack, parallel strings together."""
    area_m2: float
    """Projected from above."""
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
    """Return the speed at which the drone stays in the air longest, eq. (18)."""
    return _optimal_speed_m_s(drone, ENDURANCE_SPEED)


def range_speed_m_s(drone: Drone) -> float:
    """Return the speed at which the drone gets farthest, eq. (18)."""
    return _optimal_speed_m_s(drone, RANGE_SPEED)


def power_w(drone: Drone, speed_m_s: float) -> float:
    """Return the electric power in level flight through still air.

    The quartic has P(0) = P_hover, its minimum of 0.914 P_hover at the speed of best endurance, and at the speed of
    best range 1.092 P_hover with the tangent through the origin that makes it the best. It is meant for speeds up to
    about 1.2 times that of best range.

    Raises:
        InstanceError: the speed is negative or not a number.
    """
    if not (math.isfinite(speed_m_s) and speed_m_s >= 0):
        raise InstanceError(f"speed is {speed_m_s} m/s, expected zero or more")
    ratio = 1.0
    for exponent, coefficient in enumerate(_power_shape(drone), start=1):
        ratio += coefficient * speed_m_s**exponent
    return hover_power_w(drone) * ratio


def usable_wh(drone: Drone, power_w: float) -> float:
    """Return what a full battery gives at a steady electric power: a hard drawn pack gives less, eq. (21).

    Raises:
        InstanceError: the power is more than the pack can give at all.
    """
    cell_w_per_ah = power_w / (drone.cells * drone.capacity_ah)
    share = sum(coefficient * cell_w_per_ah**exponent for exponent, coefficient in enumerate(CAPACITY))
    if share <= 0:
        raise InstanceError(f"drone {drone.name!r}: {power_w:.0f} W is more than its battery can give")
    return share * drone.capacity_ah * drone.cell_voltage_v * drone.cells


def endurance_s(drone: Drone, speed_m_s: float) -> float:
    """Return how long a full battery lasts at a speed, eq. (22)."""
    power = power_w(drone, speed_m_s)
    return 3600 * usable_wh(drone, power) / power


def pct_per_s(drone: Drone, speed_m_s: float) -> float:
    """Return what a second of level flight uses, in percent of a full battery."""
    return 100 / endurance_s(drone, speed_m_s)


def _optimal_speed_m_s(drone: Drone, coefficients: tuple[float, float, float]) -> float:
    constant, per_m_s, per_cm2 = coefficients
    induced = induced_velocity_m_s(drone)
    return induced / (constant + per_m_s * induced + per_cm2 * drone.area_m2 * 1e4)


@lru_cache(maxsize=64)
def _power_shape(drone: Drone) -> tuple[float, ...]:
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
