"""The tables of the autopilots, and what their releases say of the same parameters."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

from executor.core.telemetry.mode_evidence import MODE_CHANNEL_SETTINGS
from missions.autopilots.dialect import AUTOPILOTS, Dialect
from scripts.parameter_metadata import list_other_settings, list_uses, main, read_metadata

PX4_BUILD = os.environ.get("FAULTLINE_PX4_BUILD")
ARDUPILOT_SOURCE = os.environ.get("FAULTLINE_ARDUPILOT_SOURCE")
BOTH = pytest.mark.parametrize("dialect", AUTOPILOTS, ids=[dialect.name for dialect in AUTOPILOTS])


def metadata_of(dialect: Dialect, path: Path, **changes: Any) -> Path:
    """Write what a release says that bears out every table, but for some parameters: None is not there."""
    named = sorted(list_other_settings(dialect) | MODE_CHANNEL_SETTINGS)
    rows: dict[str, Any] = {name: {"name": name} if dialect.name == "px4" else {} for name in named}
    for name, use in list_uses(dialect).items():
        values, bits = dict.fromkeys(use.values, "x"), dict.fromkeys((mask.bit_length() - 1 for mask in use.masks), "x")
        rows[name] = {"Values": values, "Bitmask": bits} | ({} if use.most is None else {"Range": {"high": use.most}})
        if dialect.name == "px4":
            rows[name] = {
                "name": name, "default": use.default, "max": use.most,
                "values": [{"value": key, "description": word} for key, word in values.items()],
                "bitmask": [{"index": key, "description": word} for key, word in bits.items()],
            }  # fmt: skip
    rows |= changes
    rows = {name: row for name, row in rows.items() if row is not None}
    path.write_text(json.dumps({"parameters": list(rows.values())} if dialect.name == "px4" else {"": rows}))
    return path


@BOTH
def test_every_name_of_the_tables_is_held(dialect: Dialect) -> None:
    text = resources.files("missions.autopilots").joinpath(f"{dialect.name}.toml").read_text(encoding="utf-8")
    said = {line.split("#")[0] for line in text.splitlines() if not line.startswith(("#", "remedy"))}
    named = {name for line in said for name in re.findall(r"\b[A-Z][A-Z0-9]+_[A-Z0-9_]+\b", line)}
    modes = {name for _, name in dialect.modes.other_names}
    others = {other.name for other in dialect.other_names.values()}
    assert named - modes == {*list_uses(dialect), *others}


@BOTH
def test_a_release_that_bears_the_tables_out_has_no_differences(
    dialect: Dialect, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = metadata_of(dialect, tmp_path / "release.json")
    assert main([dialect.name, str(path), "--before", str(path)]) == 0
    assert [line.rpartition(": ")[2] for line in capsys.readouterr().out.splitlines()] == ["0", "0"]


@pytest.mark.parametrize(
    ("dialect", "changes", "line"),
    [
        ("px4", {"GF_ACTION": None}, "GF_ACTION: is not there"),
        ("px4", {"COM_FLTT_LOW_ACT": None}, None),
        ("px4", {"BAT_CRIT_THR": {"name": "BAT_CRIT_THR", "values": [{"value": 9, "description": "y"}]}}, None),
        (
            "px4",
            {"NAV_DLL_ACT": {"name": "NAV_DLL_ACT", "values": [{"value": 7, "description": "Fly on"}]}},
            "NAV_DLL_ACT 7: 'Fly on' is not known here",
        ),
        ("px4", {"COM_DLL_EXCEPT": {"name": "COM_DLL_EXCEPT", "bitmask": []}}, "COM_DLL_EXCEPT: has no bit 0"),
        (
            "px4",
            {"COM_DL_LOSS_T": {"name": "COM_DL_LOSS_T", "default": 30, "max": 300}},
            "COM_DL_LOSS_T: its default is 30, here 10",
        ),
        ("ardupilot", {"WPNAV_SPEED": None}, "WPNAV_SPEED or WP_SPD: is not there"),
        ("ardupilot", {"WPNAV_SPEED": None, "WP_SPD": {}}, None),
        (
            "ardupilot",
            {"FS_GCS_TIMEOUT": {"Range": {"high": "600"}}},
            "FS_GCS_TIMEOUT: its maximum is 600, here 120",
        ),
        (
            "px4",
            {"RTL_CONE_ANG": {"name": "RTL_CONE_ANG", "min": 25, "max": 90}},
            "RTL_CONE_ANG: faultline sets it to 0, outside 25 to 90",
        ),
        ("ardupilot", {"RTL_CONE_SLOPE": {"Range": {"low": "0.5", "high": "10"}, "Values": {"0": "Disabled"}}}, None),
        ("ardupilot", {"COMPASS_OFS_X": None}, "COMPASS_OFS_X: is not there"),
        ("px4", {"SIM_BAT_DRAIN": None}, "SIM_BAT_DRAIN: is not there"),
        ("px4", {"MODE_CH": None, "FLTMODE_CH": None}, None),
        (
            "px4",
            dict.fromkeys(("FLTMODE_CH", "MODE_CH", "RC_MAP_FLTMODE")),
            "FLTMODE_CH or MODE_CH or RC_MAP_FLTMODE: is not there",
        ),
    ],
)
def test_what_the_next_release_changes_is_noticed(
    dialect: str, changes: dict[str, Any], line: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (known,) = [one for one in AUTOPILOTS if one.name == dialect]
    path = metadata_of(known, tmp_path / "release.json", **changes)
    assert main([dialect, str(path)]) == (0 if line is None else 1)
    assert capsys.readouterr().out.splitlines()[1:] == ([] if line is None else [f"  {line}"])


def test_two_releases_are_compared_by_what_they_say(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dialect = AUTOPILOTS[1]
    row = {"name": "COM_DLL_EXCEPT", "bitmask": [{"index": 0, "description": "Mission"}], "max": 31}
    before = metadata_of(dialect, tmp_path / "before.json", GF_ACTION=None)
    after = metadata_of(dialect, tmp_path / "after.json", COM_DLL_EXCEPT=row)
    main([dialect.name, str(after), "--before", str(before)])
    assert capsys.readouterr().out.splitlines()[:3] == [
        f"since {before}, changes: 2",
        "  GF_ACTION: nothing -> 0 x, 1 x, 2 x, 3 x, 4 x, 5 x",
        "  COM_DLL_EXCEPT: 0 x -> 0 Mission; at most 31",
    ]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"version": 1}', "<paramfile/>"])
def test_what_is_no_metadata_is_refused_in_one_line(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "other.json"
    path.write_text(text)
    assert main(["px4", str(path)]) == 2
    assert capsys.readouterr().err.startswith(f"{path}: expected ")


@pytest.mark.skipif(
    PX4_BUILD is None, reason="FAULTLINE_PX4_BUILD: expected PX4's build directory, with parameters.json"
)
def test_px4_as_it_was_built_bears_the_tables_out(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["px4", f"{PX4_BUILD}/parameters.json"]) == 0, capsys.readouterr().out


@pytest.mark.skipif(
    ARDUPILOT_SOURCE is None, reason="FAULTLINE_ARDUPILOT_SOURCE: expected ArduPilot's source directory, with Tools"
)
def test_ardupilot_as_its_source_documents_it_bears_the_tables_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    script = Path(str(ARDUPILOT_SOURCE)) / "Tools" / "autotest" / "param_metadata" / "param_parse.py"
    subprocess.run([sys.executable, script, "--vehicle", "Copter", "--format", "json"], cwd=tmp_path, check=True)
    assert len(read_metadata(tmp_path / "apm.pdef.json")) > 1000
    assert main(["ardupilot", str(tmp_path / "apm.pdef.json")]) == 0, capsys.readouterr().out
