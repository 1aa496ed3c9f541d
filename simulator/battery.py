"""The pack of a simulated vehicle: its charge, its voltage, and its consumption in flight.

Charge, consumed charge and current are consistent: percent = 100 - 100 * mAh / capacity always holds, as in a coulomb
counter, and percent per second is exactly the energy model's times wind, wear and fault.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from planner.energy import CLIMB_SHARE_PER_M_S, Drone, pct_per_s, power_w, top_speed_m_s

CHARGE_PCT = (0.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0)
REST_CELL_V = (3.27, 3.61, 3.69, 3.71, 3.73, 3.77, 3.80, 3.84, 3.87, 3.95, 4.02, 4.11, 4.20)
"""Resting voltage of a LiPo cell at these charges; the commonly published table."""
HOVER_SAG = 0.03
"""Voltage sag in hover, as a share of nominal: 12.6 to 12.26 V in a recorded ArduPilot flight."""


@lru_cache(maxsize=4096)
def _drain_pct_s(drone: Drone, decimetres_s: int) -> float:
    """Return percent a second at a speed in tenths of m/s; rounding keeps the cache small and costs under 1 %."""
    return pct_per_s(drone, min(decimetres_s / 10, top_speed_m_s(drone)))


class Battery:
    """One pack."""

    def __init__(self, drone: Drone, *, charge_pct: float, health: float, consumption: float) -> None:
        self._drone = drone
        self._consumption = consumption
        self._health = health
        self.charge_pct = charge_pct
        """True charge."""
        self.drain_factor = 1.0
        """Factor on consumption, set by a fault."""
        self.capacity_mah = drone.capacity_ah * 1000 * health
        nominal_v = drone.cell_voltage_v * drone.cells
        self._resistance_ohm = HOVER_SAG * nominal_v**2 / power_w(drone, 0.0) / health
        self.current_a = 0.0

    @property
    def is_empty(self) -> bool:
        """Whether it is empty."""
        return self.charge_pct <= 0.0

    @property
    def rest_v(self) -> float:
        """Pack voltage without load."""
        return float(np.interp(self.charge_pct, CHARGE_PCT, REST_CELL_V)) * self._drone.cells

    @property
    def voltage_v(self) -> float:
        """Pack voltage under the present load."""
        return max(self.rest_v - self.current_a * self._resistance_ohm, 0.0)

    def step(self, dt_s: float, *, motors: bool, speed_m_s: float, climb_m_s: float) -> None:
        """Use energy for ``dt_s`` of flight, or none with the motors off."""
        if not motors:
            self.current_a = 0.0
            return
        rate = _drain_pct_s(self._drone, round(speed_m_s * 10)) * (1 + CLIMB_SHARE_PER_M_S * max(climb_m_s, 0.0))
        rate *= self._consumption * self.drain_factor / self._health
        self.charge_pct = max(self.charge_pct - rate * dt_s, 0.0)
        self.current_a = rate / 100 * self.capacity_mah / 1000 * 3600

    def swap_pack(self, charge_pct: float) -> None:
        """Replace the pack by another of the same type."""
        self.charge_pct, self.drain_factor, self.current_a = charge_pct, 1.0, 0.0

    def remove_charge(self, points: float) -> None:
        """Remove percentage points of charge at once."""
        self.charge_pct = max(self.charge_pct - points, 0.0)
