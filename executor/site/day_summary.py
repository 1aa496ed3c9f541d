"""A plan of many sorties in words: who flies when, what each base needs, when it is done, whose loss it survives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from executor.site.plan_summary import describe_left_over
from missions import DayPlanFile
from planner.sorties import SparesEstimate

DAY_S = 86_400.0


def format_day_time(seconds: float) -> str:
    """Return a time of the days.

    >>> when(86_400 + 30_630.0)
    'day 2 at 08:30'
    """
    day, minutes = int(seconds // DAY_S) + 1, int(seconds % DAY_S // 60)
    return f"day {day} at {minutes // 60:02d}:{minutes % 60:02d}"


@dataclass(frozen=True, slots=True)
class BaseNeeds:
    """What a base needs on its hardest day."""

    name: str
    sorties: int
    """Of all days: each takes a pack, so so many swaps there are."""
    packs: int
    """In the air and being charged at once."""
    people: int
    """A pilot, and one for each vehicle that is turned round at the same time."""


def compute_base_needs(content: DayPlanFile) -> tuple[BaseNeeds, ...]:
    """Return what each base needs."""
    return tuple(
        BaseNeeds(place.name, content.count_swaps(number), packs, _count_people(content, number))
        for number, (place, packs) in enumerate(zip(content.bases, content.count_packs, strict=True))
    )


def _count_people(content: DayPlanFile, base: int) -> int:
    turned = []
    for row, own in enumerate(content.plan.sorties):
        for number, one in enumerate(own):
            if one.lands == base:
                lands_s = one.start_s + content.evaluation.lasts_s[row][number]
                turned += [(lands_s, 1), (lands_s + content.bases[base].turnaround_s, 0)]
    at_once = most = 0
    for _, begins in sorted(turned):
        at_once += 1 if begins else -1
        most = max(most, at_once)
    return 1 + most if turned or content.count_swaps(base) else 0


def describe_day_sorties(content: DayPlanFile) -> Iterator[str]:
    """Yield a line for each sortie, by day and take-off."""
    rows = [
        (one.start_s, own.name, one, lasts_s, pct)
        for own, sorties, all_lasts_s, energies in zip(
            content.vehicles, content.plan.sorties, content.evaluation.lasts_s, content.evaluation.energies_pct,
            strict=True,
        )
        for one, lasts_s, pct in zip(sorties, all_lasts_s, energies, strict=True)
    ]  # fmt: skip
    rows.sort(key=lambda row: row[:2])
    for day, (begin, end) in enumerate(content.days, 1):
        mine = [row for row in rows if begin <= row[0] < end]
        if not mine:
            continue
        last = format_day_time(max(row[0] + row[3] for row in mine))[-5:]
        yield f"day {day}: {len(mine)} sorties, the last one lands at {last}"
        for start_s, name, one, lasts_s, pct in mine:
            base, lands = content.bases[one.base].name, content.bases[one.lands].name
            onto = "" if one.lands == one.base else f", lands at {lands}"
            yield (
                f"  {format_day_time(start_s)[-5:]}  {name:<8} {base:<8} {lasts_s / 60:6.1f} min {pct:6.1f} %  "
                f"{len(one.visits):4d} segments{onto}"
            )


def describe_base_needs(content: DayPlanFile) -> Iterator[str]:
    """Yield what each base needs, and when everything is done."""
    for base, own in zip(content.bases, compute_base_needs(content), strict=True):
        there = "" if base.packs is None else f" of {base.packs}"
        yield f"base {own.name}: {own.sorties} sorties and swaps, {own.packs}{there} packs, {own.people} people"
    found = content.evaluation
    if not found.count:
        yield "nobody flies"
        return
    yield (
        f"finished on {format_day_time(found.finish_s)}: {found.count} sorties, {found.flight_s / 3600:.1f} h in the "
        f"air, by "
        f"{sum(1 for own in content.plan.sorties if own)} vehicles"
    )


def describe_loss_windows(content: DayPlanFile) -> Iterator[str]:
    """Yield until when each vehicle must not be lost for good."""
    end = format_day_time(content.days[-1][1])
    for one in content.windows:
        name = content.vehicles[one.vehicle].name
        if not content.plan.sorties[one.vehicle]:
            continue
        if one.breaks is None:
            yield f"{name} may be lost at any time: the others finish by {end}"
        else:
            yield (
                f"{name} may be lost from {format_day_time(one.from_s)} on; for its sortie {one.breaks + 1}, and "
                f"those before it, "
                f"no re-plan was found that finishes by {end}"
            )


def compute_rule_packs(content: DayPlanFile, base: int) -> int | None:
    """Return the packs of arXiv 2604.15890 for a base: m (ceil(R) + 1) for m vehicles that fly from it.

    R is the time a pack needs to fly again over the time that it flies. None where packs are charged overnight alone.
    """
    recharge_s = content.bases[base].recharge_s
    lasts_s = [
        content.evaluation.lasts_s[row][number]
        for row, own in enumerate(content.plan.sorties) for number, one in enumerate(own) if one.base == base
    ]  # fmt: skip
    flying = sum(any(one.base == base for one in own) for own in content.plan.sorties)
    if recharge_s is None or not lasts_s:
        return None
    return flying * (int(np.ceil(recharge_s / float(np.mean(lasts_s)))) + 1)


def describe_spares(content: DayPlanFile, found: list[SparesEstimate], shares: list[float]) -> Iterator[str]:
    """Yield the chance for each number of vehicles, and how many are enough."""
    fleet = sum(1 for own in content.plan.sorties if own)
    for one in found:
        lives, chance = one.lives, one.lives.finished
        yield (
            f"{fleet + len(one.spares):3d} vehicles finish in {100 * chance.estimate:.1f} % of {lives.samples} times "
            f"(95 %: {100 * chance.low:.1f} to {100 * chance.high:.1f} %), {lives.losses:.2f} losses each"
        )
    for share in shares:
        enough = find_enough_spares(found, share)
        if enough is None:
            yield f"{100 * share:g} %: not with {fleet + len(found[-1].spares)} vehicles"
            continue
        packs = ", ".join(
            f"{count} at {place.name}"
            for count, place in zip(enough.lives.packs_for_share(share), content.bases, strict=True)
        )
        spares = len(enough.spares)
        yield f"{100 * share:g} %: {fleet + spares} vehicles, {spares} of them spare; packs: {packs}"


def describe_day(content: DayPlanFile) -> list[str]:
    """Return the days in words."""
    told = (describe_day_sorties(content), describe_base_needs(content), describe_left_over(content))
    return [line for lines in (*told, describe_loss_windows(content)) for line in lines]


def find_enough_spares(found: list[SparesEstimate], share: float) -> SparesEstimate | None:
    """Return the fewest spares with which such a share was finished, and what they came to."""
    return next((one for one in found if one.lives.finished.estimate >= share), None)
