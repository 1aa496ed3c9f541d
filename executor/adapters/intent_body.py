"""An operator's intent as JSON, from the page or MQTT."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, PlainValidator, WithJsonSchema, model_validator
from pydantic_core import PydanticCustomError

from executor.core.interface.intents import LONGEST_NAME, MAX_ASSETS, MAX_PACKS, PACK, Action, ActionName, Intent


def _check_asset(value: Any) -> int | str:  # noqa: ANN401 - unvalidated input
    """Return a name or a number; a union's own error would name Python types."""
    if isinstance(value, str) and 0 < len(value) <= LONGEST_NAME:
        return value
    if isinstance(value, int) and not isinstance(value, bool) and value >= 0:
        return value
    raise PydanticCustomError("asset", "expected the name of an asset or the number of a segment")


_SCHEMA = {"anyOf": [{"type": "string", "minLength": 1, "maxLength": LONGEST_NAME}, {"type": "integer", "minimum": 0}]}
Asset = Annotated[int | str, PlainValidator(_check_asset), WithJsonSchema(_SCHEMA)]
NamedAssets = Annotated[tuple[Asset, ...], Field(min_length=1, max_length=MAX_ASSETS)]
"""At least one asset; an empty list does not mean all."""


ID = r"^[A-Za-z0-9._:-]{1,64}$"


class IntentBody(BaseModel):
    """An operator's intent."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, use_attribute_docstrings=True, defer_build=True)

    id: Annotated[str, Field(pattern=ID)]
    """Unique id chosen by the sender. A repeated id gets the same answer and is not carried out again."""
    action: ActionName
    """Action; `prepare` and `take-off` answer the questions before the flight."""
    vehicle: Annotated[str, Field(min_length=1, max_length=32)] | None = None
    """Vehicle; omitted for `replan`, `prove`, `close`, `open`, `count`, `abort`, `prepare` and `take-off`."""
    confirmed: bool = False
    """Whether the operator confirmed the question of the acknowledgement."""
    pack: Annotated[str, Field(pattern=PACK)] = ""
    """Id of the inserted battery pack, for `swap`; omitted if packs have none."""
    base: Annotated[str, Field(max_length=64)] = ""
    """Base of the day, for `close`, `open` and `count`."""
    charged: Annotated[int, Field(ge=0, le=MAX_PACKS)] | None = None
    """Number of charged packs at the base now, for `count`."""
    assets: NamedAssets = ()
    """Assets to inspect again, for `prove`: names or segment numbers; omitted for all that are inferred or missed."""

    @model_validator(mode="after")
    def _check_assets(self) -> Self:
        if self.assets and self.action != "prove":
            raise ValueError(f"assets: expected none, as {self.action} is for no single one")
        if (self.charged is None) is (self.action == "count"):
            raise ValueError("charged: expected a number of packs for count, and none for anything else")
        return self

    def build_intent(self, source: str) -> Intent:
        """Return the intent, with its source."""
        action = Action(self.action)
        return Intent(
            self.id, action, self.vehicle, source, self.confirmed, self.pack, self.base, self.assets, self.charged
        )
