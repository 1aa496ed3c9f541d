"""Define the command that replays recorded flights."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from pydantic import TypeAdapter

from executor.adapters.extras import Extra, require_extra
from executor.adapters.run_directory import RunDirectory
from executor.cli.options import JsonOption
from executor.cli.plan_inputs import print_result, write_named_file
from executor.core.interface.messages import Actor
from executor.core.interface.recorded_log import SkippedRecords
from executor.errors import LogError
from executor.replay.log_replay import ReplayRules, build_replay_rules, replay_log
from executor.replay.open_log import is_log, open_log
from executor.replay.replay_result import LogReplay, VehicleReplay, format_pack_lines, merge_packs
from executor.replay.run_replay import RunReplay, replay_run
from executor.site.learned_files import PacksDocument
from executor.site.site_file import Site, read_site
from executor.site.site_model import drone_of
from missions.files import json_text, write_whole
from planner import PRESETS

LogsArgument = Annotated[
    list[Path],
    typer.Argument(metavar="LOG...", help=".tlog, .BIN, .log or .ulg files, run directories, folders of logs."),
]
NOT_SHOWN = {"samples", "packs"}
"""Vehicle fields that the JSON leaves out."""


def replay_logs(
    logs: LogsArgument,
    site: Annotated[
        Path | None, typer.Option(metavar="SITE", help="Judge by the vehicles, reserves and thresholds of this site.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="DIR", help="Directory for a timeline and a page per log; with --learn the file."
        ),
    ] = None,
    learn: Annotated[
        bool,
        typer.Option(
            "--learn", help="Learn one aircraft from its logs, and write [energy] and [learned] for its site."
        ),
    ] = False,
    packs: Annotated[
        Path | None,
        typer.Option(
            "--packs", metavar="FILE", help="Add the packs' measured state from the flights to this packs.json."
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Run recorded flights through the fault detection of a live flight: what it declares, when and why.

    For a run directory every decision is made again; exit 1 if one differs from the flight's.
    """
    known = None if site is None else read_site(site)
    paths = [path for given in logs for path in find_logs(given)]
    if learn:
        _learn(paths, known, output, as_json=as_json)
        return
    if output is not None:
        require_extra(Extra.PICTURES, "--output")
    rules = build_replay_rules(known)
    # One unreadable log of many must not stop the others.
    done = [_replay(path, rules) if len(paths) == 1 else _replay_or_report(path, rules) for path in paths]
    if output is not None:
        _write(done, output)
    history = None if packs is None else _update_packs(done, packs, known)
    lines = [line for one in done for line in _describe(one)]
    lines += [] if history is None else format_pack_lines(history)
    differs = any(isinstance(one, RunReplay) and not one.comparison.is_same for one in done)
    is_no = differs or not any(one.vehicles for one in done)
    print_result(lambda: build_replay_document(done), lines, as_json=as_json, answer_is_no=is_no)


def _update_packs(done: Sequence[LogReplay], path: Path, site: Site | None) -> PacksDocument:
    """Add the flights' pack data to a file, and return its whole content."""
    known = merge_packs((), PacksDocument.read(path) if path.exists() else None)
    for one in done:
        run = RunDirectory(one.path)
        own = read_site(run.site) if site is None and run.site.exists() else site
        tables = () if own is None else own.vehicle
        labels = {table.sysid: table.pack for table in tables if table.pack is not None}
        known = merge_packs([one], known, labels)
    write_named_file(path, known.write)
    return known


def find_logs(path: Path) -> list[Path]:
    """Return the logs that a path names: itself, a run directory, or those in a folder.

    Raises:
        LogError: there is none.
    """
    if not path.exists():
        raise LogError(f"{path}: no such file; expected a log, a run directory or a folder of logs")
    if not path.is_dir() or RunDirectory(path).events.exists():
        return [path]
    found = sorted(one for one in path.iterdir() if is_log(one))
    if not found:
        raise LogError(f"{path}: expected a run directory, or a folder with .tlog, .BIN or .ulg files")
    return found


def _replay_or_report(path: Path, rules: ReplayRules) -> LogReplay:
    try:
        return _replay(path, rules)
    except LogError as error:
        return LogReplay(path, (), SkippedRecords(), 0, 0.0, (str(error).removeprefix(f"{path}: "),))


def _replay(path: Path, rules: ReplayRules) -> LogReplay:
    return replay_run(path) if path.is_dir() else replay_log(open_log(path), rules)


def build_replay_document(done: Sequence[LogReplay]) -> dict[str, object]:
    """Return the result as JSON."""
    total = SkippedRecords()
    for one in done:
        for name, count in one.skipped.counts().items():
            setattr(total, name, getattr(total, name) + count)
    return {
        "vehicles": [vehicle for one in done for vehicle in _build_vehicle_entries(one)],
        "skipped": total.counts(),
        "logs": [
            {
                "log": str(one.path),
                "began_usec": one.began_usec,
                "lasted_s": round(one.lasted_s, 3),
                "vehicles": _build_vehicle_entries(one),
                "skipped": one.skipped.counts(),
                "notes": list(one.notes),
                "commands": {
                    "logged": one.comparison.logged, "replayed": one.comparison.replayed,
                    "same": one.comparison.is_same, "first_difference": one.comparison.first_difference,
                } if isinstance(one, RunReplay) else None,
            }
            for one in done
        ],
    }  # fmt: skip


def _build_vehicle_entries(found: LogReplay) -> list[dict[str, object]]:
    rows = TypeAdapter(tuple[VehicleReplay, ...]).dump_python(
        found.vehicles, mode="json", exclude={"__all__": NOT_SHOWN}
    )
    return [
        {"log": str(found.path), **row, "flown_s": round(row["flown_s"], 1), "skipped": found.skipped.counts()}
        for row in rows
    ]


BY: Mapping[Actor, str] = {
    Actor.PILOT: "by its pilot",
    Actor.GROUND_STATION: "by a ground station",
    Actor.FAILSAFE: "by its own failsafe",
    Actor.MISSION: "by its mission",
    Actor.UNKNOWN: "by an unknown source",
}
"""Author of a mode change, in words."""


def _describe(found: LogReplay) -> Iterator[str]:
    yield f"{found.path}: {found.lasted_s / 60:.1f} min"
    for note in found.notes:
        yield f"  {note}"
    if isinstance(found, RunReplay) and found.comparison.is_same:
        yield f"  the same {found.comparison.logged} decisions as the flight"

    def at(usec: int) -> str:
        return f"{(usec - found.began_usec) / 1e6:.1f} s"

    for vehicle in found.vehicles:
        yield f"  {vehicle.name} (system {vehicle.sysid}, {vehicle.autopilot}), flown {vehicle.flown_s / 60:.1f} min"
        yield from _describe_vehicle(vehicle, at)
    skipped = [f"{name.replace('_', ' ')} {count}" for name, count in found.skipped.counts().items() if count]
    if skipped:
        yield f"  skipped: {', '.join(skipped)}"


def _describe_vehicle(vehicle: VehicleReplay, at: Callable[[int], str]) -> Iterator[str]:
    for one in vehicle.declarations:
        yield f"    declared  {at(one.t_usec):>9}  {one.kind.value:<12}  {one.reason:<16}  {one.evidence}"
    for mode in vehicle.modes:
        why = f": {mode.why}" if mode.why else ""
        yield f"    mode      {at(mode.t_usec):>9}  {mode.mode:<12}  {BY[mode.by]}{why}"
    for two in vehicle.degraded:
        span = f"{at(two.from_usec)} to {at(two.to_usec)}"
        yield f"    degraded  {span:>9}  {two.kind.value}, {two.reason}: {two.evidence}"
    if not vehicle.declarations:
        yield "    no declaration"


def _write(done: Sequence[LogReplay], folder: Path) -> None:
    from executor.replay.timeline import draw_replay, write_replay_page

    write_named_file(folder, lambda path: path.mkdir(parents=True, exist_ok=True))
    for one in done:
        picture = folder / f"{one.path.resolve().name}.png"
        page = folder / f"{one.path.resolve().name}.html"
        write_named_file(picture, partial(draw_replay, one))
        write_named_file(page, partial(write_replay_page, one, picture))


def _learn(paths: Sequence[Path], site: Site | None, output: Path | None, *, as_json: bool) -> None:
    from executor.replay.learning import build_learned_table, describe_aircraft, format_learned_toml, learn_from_logs

    found = learn_from_logs([path for path in paths if not path.is_dir()])
    drone, base = ("mavic3", PRESETS["mavic3"]) if site is None else (site.energy.drone, drone_of(site))
    content = format_learned_toml(found, drone, base)
    write_named_file(output, lambda path: write_whole(path, content.encode()))
    if as_json:
        print(json_text({"system": found.system, "left_out": found.others, **build_learned_table(found)}))
    elif output is None:
        print(content, end="")
    else:
        print("\n".join(describe_aircraft(found)))
