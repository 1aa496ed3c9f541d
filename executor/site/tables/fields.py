"""What the values of a site file may be."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Percent = Annotated[float, Field(ge=0, le=100)]
Positive = Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]
Metres = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
Speed = Annotated[float, Field(ge=0.01, le=1000, allow_inf_nan=False)]
WindSpeed = Annotated[float, Field(ge=-20, le=20)]
HostName = Annotated[
    str, Field(max_length=253, pattern=r"^([0-9A-Fa-f:.]*:[0-9A-Fa-f:.]*|[A-Za-z0-9_-]{1,63}(\.[A-Za-z0-9_-]{1,63})*)$")
]
"""A name, or an address of version 4 or 6."""
LayerName = Annotated[str, Field(min_length=1, max_length=200)]
FileName = Annotated[str, Field(min_length=1, pattern=r"^[^\x00]+$")]
EnvironmentName = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,63}$")]


class SiteTable(BaseModel):
    """A table of the file: it has no other keys than its own."""

    model_config = ConfigDict(extra="forbid", frozen=True)
