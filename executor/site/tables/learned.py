"""The table that `faultline replay --learn` writes and a site file may keep: what an aircraft's own logs say of it."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from executor.site.tables.fields import SiteTable

Amount = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
Deviation = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1, le=1_000_000)]


class FigureTable(SiteTable):
    """One learned figure; the other figures have the same keys."""

    mean: Amount
    """What was found."""
    sd: Deviation
    """How sure it is: standard deviation."""
    samples: Count
    """How many pieces of flight, pairs of reports or minutes it is from."""


class SpeedTable(SiteTable):
    """Consumption in level flight at one speed."""

    speed_m_s: Annotated[float, Field(ge=0, le=200)]
    """Over ground, the mean of what was flown."""
    current_a: FigureTable
    """Current that was drawn."""
    pct_per_min: FigureTable | None = None
    """The same in percent of the learned capacity a minute."""


class SwitchTable(SiteTable):
    """The pilot's mode switch."""

    channel: Annotated[int, Field(ge=1, le=18)]
    """Of the transmitter."""
    source: Annotated[str, Field(max_length=60)]
    """Parameter that names it, or `seen`: it moved before changes of mode."""
    moved: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    """Changes of mode that it moved before."""
    changes: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    """Changes of mode in the logs."""


class LearnedTable(SiteTable):
    """What `faultline replay --learn` found. It changes no plan: `[energy]` does, which the same command writes."""

    logs: Count
    """Logs that it is from."""
    minutes: Annotated[float, Field(ge=0, le=1e6)]
    """In the air."""
    hover_a: FigureTable | None = None
    """Current in hover."""
    hover_w: FigureTable | None = None
    """Power in hover."""
    level: tuple[SpeedTable, ...] = ()
    """Level flight, by speed."""
    climb_share: FigureTable | None = None
    """Extra consumption for each m/s of climb, as a share of level flight's."""
    capacity_ah: FigureTable | None = None
    """What the counter of charge gives for the percentage that is shown."""
    resistance_ohm: FigureTable | None = None
    """Of the pack with its wires, from steps of the load."""
    link_loss_pct: FigureTable | None = None
    """Frames that were lost on the way to the ground station."""
    mode_switch: SwitchTable | None = None
    """The pilot's mode switch."""
