"""What is said of a document that does not fit its model: one line, the key, and what was expected there."""

from __future__ import annotations

from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from missions import format_first_error
from missions.validation import Figure, Flag, Id, Text


class Row(BaseModel):
    model_config = ConfigDict(extra="forbid")

    id: Id = 0
    share: Figure = 0.5
    flag: Flag = False
    name: Text = "a"
    kind: Literal["hill", "dale"] = "hill"
    pair: tuple[Figure, Figure] = (0.0, 0.0)

    @model_validator(mode="after")
    def _fitting(self) -> Row:
        if self.name == self.kind:
            raise ValueError("name: expected another word than the kind")
        return self


class Table(BaseModel):
    rows: Annotated[tuple[Row, ...], Field(min_length=1)]


def reason(document: str, *, shown: bool = True) -> str:
    with pytest.raises(ValidationError) as caught:
        Table.model_validate_json(document)
    return format_first_error(caught.value, page="docs/rows.md", shown=shown)


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ('"id": true', "rows[1].id: expected a whole number, got True"),
        ('"id": "7"', "rows[1].id: expected a whole number, got '7'"),
        ('"id": 7.5', "rows[1].id: expected a whole number, got 7.5"),
        ('"id": -7', "rows[1].id: expected greater than or equal to 0, got -7"),
        ('"share": true', "rows[1].share: expected a number, got True"),
        ('"share": "0.5"', "rows[1].share: expected a number, got '0.5'"),
        ('"share": NaN', "rows[1].share: expected a finite number, got nan"),
        ('"share": Infinity', "rows[1].share: expected a finite number, got inf"),
        ('"share": 1e13', "rows[1].share: expected less than or equal to 1000000000000, got 10000000000000.0"),
        ('"flag": 1', "rows[1].flag: expected true or false, got 1"),
        ('"name": 3', "rows[1].name: expected a text, got 3"),
        ('"kind": "sea"', "rows[1].kind: expected 'hill' or 'dale', got 'sea'"),
        ('"pair": [1]', "rows[1].pair[1]: expected one more value"),
        ('"pair": 1', "rows[1].pair: expected a list, got 1"),
        ('"name": "hill"', "rows[1].name: expected another word than the kind"),
        ('"colour": 1', "rows[1].colour: unknown key; expected one that docs/rows.md names"),
        ('"two\\nlines": 1', "rows[1].two lines: unknown key; expected one that docs/rows.md names"),
    ],
)
def test_the_key_and_what_was_expected(row: str, expected: str) -> None:
    assert reason(f'{{"rows": [{{}}, {{{row}}}]}}') == expected


def test_the_document_as_a_whole() -> None:
    assert reason("[]") == "content: expected keys with values, got []"
    assert reason("{}") == "rows: expected this key, but it is missing"
    assert reason('{"rows": []}') == "rows: expected at least one row"
    assert reason('{"rows":\n').startswith("content: expected JSON: ")
    assert reason("[" * 100_000).startswith("content: expected JSON: ")


def test_a_long_value_is_cut_and_a_secret_is_not_shown() -> None:
    text = reason(f'{{"rows": [{{"kind": "{"x" * 500}"}}]}}')
    assert text.endswith("xxx...")
    assert len(text) < 120
    assert reason('{"rows": [{"kind": "secret"}]}', shown=False) == "rows[0].kind: expected 'hill' or 'dale'"
