"""Windows plans, checks, replays and serves the plan page; to fly, it says in one line what to use."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from executor.core.preflight.parameter_changes import ChangeStage, KeptParameter
from executor.flight.restore_vehicles import PARAMETERS
from planner.kernels import compiling
from tests.recorded import Writer, flight
from tests.test_extras import SITE, called

WINDOWS = "import tests.windows; tests.windows.pretend()"
DONE = (
    "--version",
    "plan site.toml --seconds 0.1 -o plan.json",
    "check plan.json",
    "window plan.json",
    "replan plan.json --lost uav1 --at 20 --seconds 0.1",
    "export plan.json -o exported",
    "replay flight.tlog",
)
NOT_FLOWN = ("fly site.toml --yes --run run1", "demo --run run2", "restore run --yes --quiet")


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, tuple[int, str, str]]:
    folder = tmp_path_factory.mktemp("windows")
    (folder / "site.toml").write_text(SITE, encoding="utf-8")
    writer = Writer()
    flight(writer, 1, range(60))
    writer.write(folder / "flight.tlog")
    (folder / "run").mkdir()
    changed = KeptParameter("uav1", 1, "ardupilot", "RTL_ALT", 1500.0, 2700.0, 6, "cm", "", stage=ChangeStage.SET)
    PARAMETERS.write(folder / "run", [changed])
    (folder / "run" / "site.toml").write_text(SITE, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        # Where Windows has them nobody has compiled the kernels yet: half a minute, and minutes on a busy computer.
        patch.setenv("NUMBA_CACHE_DIR", str(compiling._find_user_cache()))
        return called(folder, [*DONE, *NOT_FLOWN], first=WINDOWS)


@pytest.mark.parametrize("call", DONE)
def test_windows_does_it(call: str, said: Mapping[str, tuple[int, str, str]]) -> None:
    code, _, err = said[call]
    assert (code, "faultline:" in err) == (0, False), err


@pytest.mark.parametrize("call", NOT_FLOWN)
def test_windows_flies_nothing_and_says_what_does(call: str, said: Mapping[str, tuple[int, str, str]]) -> None:
    code, _, err = said[call]
    assert (code, err.splitlines()[-1].count("WSL 2")) == (2, 1), err
    assert "Traceback" not in err
