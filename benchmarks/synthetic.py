"""Synthetic power-line networks of any size, for measuring the growth of time and memory."""

from __future__ import annotations

import math

import numpy as np

from planner.moves import FloatArray

SPAN_M = (200.0, 350.0)
"""Shortest and longest distance between two pylons."""
TRUNKS = 5
"""Lines that leave the substation at (0, 0)."""
BRANCHES = 0.04
"""Share of pylons where a branch line begins."""
BENDS = 0.12
"""Share of pylons where the line turns."""
BEND_RAD = 0.35
"""Standard deviation of a turn."""


def generate_network(segments: int, seed: int) -> FloatArray:
    """Return (n, 2, 2) float64, the end points in metres of the spans of a branching network about (0, 0).

    Lines grow span by span in turn, with occasional bends and branches. The same seed gives the same network, and a
    smaller one is the start of a larger.
    """
    chance = np.random.default_rng(seed)
    tips = [(0.0, 0.0, (2 * math.pi * (trunk + chance.uniform(0, 0.7))) / TRUNKS) for trunk in range(TRUNKS)]
    ends = np.empty((segments, 2, 2))
    for span in range(segments):
        turn = span % len(tips)
        east_m, north_m, heading = tips[turn]
        if chance.random() < BENDS:
            heading += chance.normal(0, BEND_RAD)
        length_m = chance.uniform(*SPAN_M)
        there = (east_m + length_m * math.cos(heading), north_m + length_m * math.sin(heading))
        ends[span] = (east_m, north_m), there
        tips[turn] = (*there, heading)
        if chance.random() < BRANCHES:
            tips.append((*there, heading + chance.choice((-1, 1)) * chance.uniform(0.8, 1.8)))
    return ends
