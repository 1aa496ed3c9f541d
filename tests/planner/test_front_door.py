"""What others may import from the planner."""

from __future__ import annotations

from types import ModuleType

import planner


def test_all_is_exactly_what_is_public() -> None:
    public = {
        name
        for name, member in vars(planner).items()
        if not name.startswith("_") and not isinstance(member, ModuleType)
    }
    # The functions named as their modules: solve and evaluate hide them.
    assert public == set(planner.__all__)
    assert len(planner.__all__) == len(set(planner.__all__))
