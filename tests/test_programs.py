"""A test that needs a program is skipped without it, and fails where all programs must be there."""

from __future__ import annotations

import pytest

from tests import programs


@pytest.mark.parametrize(("ci", "end"), [("", pytest.skip.Exception), ("true", pytest.fail.Exception)])
def test_a_missing_program_ends_a_test(monkeypatch: pytest.MonkeyPatch, ci: str, end: type[BaseException]) -> None:
    monkeypatch.setenv("CI", ci)
    monkeypatch.setattr(programs, "NAMES", {"gone": ("faultline-gone", "faultline-gone-too"), "shell": ("gone", "sh")})
    programs.need("shell")
    with pytest.raises(end, match="gone is not installed"):
        programs.need("gone")
