"""Whether pictures show the whole of a span, and which stretch of it they do not."""

from __future__ import annotations

from collections.abc import Iterable

from missions.cameras import SpanCameraTask, Trigger

LATE_M = 2.5
"""A picture may be taken, or said to be, this much later than it was asked for; two fixes add to it."""
SPACES = 1.5
"""Times the distance that was asked for: one picture that is missing leaves twice as much."""
FILM_S = 3.0
"""A camera says once a second that it films, and a word may be lost."""


def max_picture_spacing_m(look: SpanCameraTask, speed_m_s: float) -> float:
    """Return how far two pictures next to each other may be apart."""
    if look.trigger is Trigger.VIDEO:
        return FILM_S * speed_m_s + LATE_M
    return SPACES * look.every_m + LATE_M


def find_unseen_stretches(length_m: float, seen_at_m: Iterable[float], most_m: float) -> list[tuple[float, float]]:
    """Return the stretches of a span that no picture shows, from a.

    Args:
        length_m: Of the span's flight track.
        seen_at_m: Where along it pictures were taken that count.
        most_m: How far two of them may be apart, and the first and the last from the ends.

    >>> find_unseen_stretches(40.0, [0.0, 10.0, 30.0, 40.0], 15.0)
    [(10.0, 30.0)]
    """
    places = sorted(min(max(at_m, 0.0), length_m) for at_m in seen_at_m)
    return [
        (before, after)
        for before, after in zip([0.0, *places], [*places, length_m], strict=True)
        if after - before > most_m
    ]
