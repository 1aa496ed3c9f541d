"""How an intent names assets, and what is no name: one line that says what was expected."""

from __future__ import annotations

import pytest
from pydantic import BaseModel, ConfigDict, ValidationError

from executor.adapters.intent_body import NamedAssets
from missions import format_first_error


class Wanting(BaseModel):
    model_config = ConfigDict(strict=True)
    assets: NamedAssets = ()


def complaint(assets: object) -> str:
    with pytest.raises(ValidationError) as wrong:
        Wanting.model_validate({"assets": assets})
    return format_first_error(wrong.value, shown=False)


def test_names_and_numbers_stay_what_they_are() -> None:
    assert Wanting.model_validate_json('{"assets": ["V101-3", 17, "17"]}').assets == ("V101-3", 17, "17")
    assert Wanting().assets == ()


@pytest.mark.parametrize("wrong", ["", "a" * 129, True, 1.5, -1, None, ["V101-3"]])
def test_what_names_no_asset(wrong: object) -> None:
    assert complaint(("V101-3", wrong)) == "assets[1]: expected the name of an asset or the number of a segment"


def test_a_list_that_came_out_empty_is_not_all_of_them() -> None:
    assert complaint(()) == "assets: expected at least one asset"
    assert complaint(tuple(range(101))).startswith("assets: expected at most 100")
