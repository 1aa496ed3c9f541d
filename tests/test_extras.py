"""An installation without the extras: what needs one says so in one line, and nothing else misses it."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import pytest

from executor.adapters.extras import Extra, packages_of
from executor.replay.open_log import ULOG_MAGIC
from tests.patience import PATIENCE_S

ROOT = Path(__file__).parents[1]
SITE = """
[network]
file = "default"
radius_m = 400

[[vehicle]]
name = "uav1"
connection = "udpin://127.0.0.1:14551"
sysid = 1
autopilot = "px4"

[[vehicle]]
name = "uav2"
connection = "udpin://127.0.0.1:14552"
sysid = 2
autopilot = "ardupilot"
"""
WITHOUT = """
import contextlib, io, json, sys
hidden, calls = json.loads(sys.argv[1])
sys.modules.update(dict.fromkeys(hidden))  # as if they were not installed
from executor.cli.main import main
done = []
for call in calls:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main(call)
        except SystemExit as end:
            done.append((end.code, out.getvalue(), err.getvalue()))
print(json.dumps(done))
"""
HEAVY = {name for extra in Extra for name in extra.modules}
GOES_ON = (
    "plan site.toml --seconds 0.1 -o plan.json",
    "check plan.json",
    "window plan.json",
    "risk plan.json --mtbf 1 --samples 10 --jobs 1",
    "export plan.json -o exported",
)
"""What is done without any extra."""
REFUSED = {
    "plan site.toml --picture plan.png": ("--picture", Extra.PICTURES),
    "plan site.toml --front --picture front.png": ("--picture", Extra.PICTURES),
    "window plan.json --picture window.png": ("--picture", Extra.PICTURES),
    "window plan.json --prove": ("--prove", Extra.PROOFS),
    "risk plan.json --mtbf 1 --picture risk.png": ("--picture", Extra.PICTURES),
    "risk plan.json --mtbf 1 --dask tcp://127.0.0.1:1": ("--dask", Extra.DASK),
    "replay flight.ulg": ("flight.ulg: a ULog", Extra.LOGS),
    "replay flight.tlog --output out": ("--output", Extra.PICTURES),
    "fly mavsdk.toml --yes": ('backend = "mavsdk"', Extra.MAVSDK),
    "preflight mavsdk.toml": ('backend = "mavsdk"', Extra.MAVSDK),
    "bench upload": ("bench upload", Extra.MAVSDK),
    "bench table --network default": ("bench table", Extra.PICTURES),
    "bench solvers --part scale": ("bench solvers --part scale", Extra.PICTURES),
    "bench fleet --out out": ("bench fleet --out", Extra.PICTURES),
    "network poles.xlsx": ("poles.xlsx: a workbook", Extra.GEO),
    "network lines.zip": ("lines.zip: a shapefile", Extra.GEO),
    "fly mapped.toml --yes": ("[map] background", Extra.MAPS),
    "plan over.toml": ("ground.tif: a raster", Extra.TERRAIN),
    "bench terrain": ("bench terrain", Extra.TERRAIN),
    "images . --run .": ("faultline images", Extra.IMAGES),
}
"""What needs one: in whose words, and which."""


def build_command(hidden: Collection[str], calls: Sequence[str], *, first: str = "") -> list[str]:
    """Return a command that calls the command line in a process in which something is done first."""
    order = json.dumps([sorted(hidden), [call.split() for call in calls]])
    start = f"import sys; sys.path.insert(0, {str(ROOT)!r}); {first}{WITHOUT}"
    return [sys.executable, "-X", "warn_default_encoding", "-c", start, order]


def called(folder: Path, calls: Sequence[str], *, first: str = "") -> Mapping[str, tuple[int, str, str]]:
    """Call the command line in a process without any extra; return exit code, output and errors of each call."""
    command = build_command(HEAVY, calls, first=first)
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stderr
    return {call: (code, out, err) for call, (code, out, err) in zip(calls, json.loads(done.stdout), strict=True)}


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, tuple[int, str, str]]:
    folder = tmp_path_factory.mktemp("without")
    (folder / "site.toml").write_text(SITE, encoding="utf-8")
    (folder / "mapped.toml").write_text(f'{SITE}\n[map]\nbackground = "ortho.tif"\n', encoding="utf-8")
    (folder / "over.toml").write_text(f'{SITE}\n[terrain]\nfiles = "ground.tif"\n', encoding="utf-8")
    (folder / "ground.tif").write_bytes(b"")
    (folder / "mavsdk.toml").write_text(f'{SITE}backend = "mavsdk"\n', encoding="utf-8")
    (folder / "flight.ulg").write_bytes(ULOG_MAGIC)
    for name, inside in (("poles.xlsx", "xl/workbook.xml"), ("lines.zip", "lines.shp")):
        with zipfile.ZipFile(folder / name, "w") as archive:
            archive.writestr(inside, b"")
    (folder / "flight.tlog").write_bytes(b"")
    (folder / "run").mkdir()
    return called(folder, [*GOES_ON, *REFUSED])


@pytest.mark.parametrize("call", GOES_ON)
def test_what_needs_none_is_done_without(call: str, said: Mapping[str, tuple[int, str, str]]) -> None:
    code, _, err = said[call]
    assert (code, "faultline:" in err) == (0, False), err


@pytest.mark.parametrize("call", REFUSED)
def test_a_missing_one_is_one_line_that_says_what_to_install(
    call: str, said: Mapping[str, tuple[int, str, str]]
) -> None:
    wanted_by, extra = REFUSED[call]
    line = f"faultline: {wanted_by} needs the extra {extra.value[0]}: pip install {' '.join(packages_of(extra))}\n"
    assert said[call] == (2, "", line)


def test_each_extra_is_refused_somewhere() -> None:
    assert {extra for _, extra in REFUSED.values()} == set(Extra)


def test_the_extras_are_those_of_the_package() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    named = project["optional-dependencies"]
    always = {re.split(r"[^\w-]", one)[0] for one in project["dependencies"] if ";" not in one}
    for extra in Extra:
        assert {re.split(r"[^\w-]", one)[0] for one in named[extra.value[0]]} == set(packages_of(extra))
        assert always.isdisjoint(extra.modules)
    whole = {name for one in named["all"] for name in re.findall(r"[\w-]+", one.partition("[")[2])}
    assert whole == {name for name, brings in named.items() if brings} - {"all"}


def test_taking_a_flight_up_loads_only_what_every_flight_has() -> None:
    """The vehicles wait for our heartbeat meanwhile."""
    command = [sys.executable, "-X", "importtime", "-c", "import executor.flight.resume_flight"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=PATIENCE_S)
    loaded = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines() if line.startswith("import time:")}
    assert "executor.flight.run_flight" in loaded
    assert {name.partition(".")[0] for name in loaded} & (
        HEAVY | {"numba", "aiomqtt", "paho", "starlette", "uvicorn", "anyio"}
    ) == set()
    parts = ("executor.adapters.mqtt.publisher", "executor.adapters.web", "executor.analysis.pictures", "benchmarks")
    assert {name for name in loaded if name.startswith(parts)} == set()
    assert {name for name in loaded if name.startswith("simulator.")} == {"simulator.common_time", "simulator.truth"}
