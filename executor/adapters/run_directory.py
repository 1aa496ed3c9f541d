"""The run directory: everything that one flight leaves."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import tomli_w

from executor.errors import LogError
from missions.files import write_whole


@dataclass(frozen=True, slots=True)
class RunDirectory:
    """Where each file of one flight lies; which of them are there depends on how far it came."""

    path: Path

    @property
    def site(self) -> Path:
        """Return the site file that it was flown with."""
        return self.path / "site.toml"

    @property
    def events(self) -> Path:
        """Return the event log, from which everything else can be had again."""
        return self.path / "events.jsonl"

    @property
    def checkpoints(self) -> tuple[Path, Path]:
        """Return the last two checkpoints: while one is written, the other is whole."""
        return self.path / "checkpoint-a.jsonl", self.path / "checkpoint-b.jsonl"

    @property
    def vehicles(self) -> Path:
        """Return who stood where, and what was on board, before the launch."""
        return self.path / "vehicles.json"

    @property
    def parameters(self) -> Path:
        """Return what was changed on board, and is to be given back."""
        return self.path / "parameters.json"

    @property
    def fences(self) -> Path:
        """Return the fences and rally points that were replaced on board, and are to be given back."""
        return self.path / "fences.json"

    @property
    def report(self) -> Path:
        """Return what the flight came to."""
        return self.path / "report.json"

    @property
    def learned(self) -> Path:
        """Return what the flight taught about its vehicles."""
        return self.path / "learned.json"

    @property
    def learned_before(self) -> Path:
        """Return what was known of them before it; not there if nothing was."""
        return self.path / "learned-before.json"

    @property
    def page(self) -> Path:
        """Return the report to be read by people."""
        return self.path / "report.html"

    @property
    def map(self) -> Path:
        """Return the map of the plan and of the flight."""
        return self.path / "map.png"

    @property
    def profile(self) -> Path:
        """Return the first plan from the side; not there if no raster knew the ground."""
        return self.path / "profile.png"

    @property
    def battery(self) -> Path:
        """Return the picture of the batteries."""
        return self.path / "battery.png"

    @property
    def terrain(self) -> Path:
        """Return the ground that it was flown over; not there if no raster knew it."""
        return self.path / "terrain.npz"

    @property
    def next_sortie(self) -> Path:
        """Return the plan of what was left over."""
        return self.path / "next-sortie.json"

    @property
    def day_plan(self) -> Path:
        """Return the day plan that it was flown by; not there for a single flight."""
        return self.path / "day-plan.json"

    @property
    def packs(self) -> Path:
        """Return what its packs gave; not there if none was changed."""
        return self.path / "packs.json"

    @property
    def truths(self) -> Path:
        """Return what a simulated fleet notes: what really happened, and when."""
        return self.path / "truth.jsonl"

    @property
    def lock(self) -> Path:
        """Return the file that is locked while the directory is flown."""
        return self.path / ".lock"

    @property
    def images_csv(self) -> Path:
        """Return the pictures of the flight, as a table."""
        return self.path / "images.csv"

    @property
    def images_geojson(self) -> Path:
        """Return the same with the assets, for maps."""
        return self.path / "images.geojson"

    @property
    def images_sqlite(self) -> Path:
        """Return the same as tables, which the files of the cards are matched to."""
        return self.path / "images.sqlite"

    @property
    def images_files(self) -> Path:
        """Return which file is which picture."""
        return self.path / "images-files.csv"

    @property
    def assets(self) -> Path:
        """Return the page of every asset with its pictures."""
        return self.path / "assets.html"

    def plan(self, revision: int) -> Path:
        """Return a plan: the first is 0, every re-plan one more."""
        return self.path / f"plan-{revision:03d}.json"

    def telemetry(self, vehicle: str) -> Path:
        """Return a vehicle's telemetry log; a long one has further parts beside it."""
        return self.path / f"{vehicle}.tlog"


def new_run_directory(wanted: Path | None) -> Path:
    """Make the directory of a run; by default a dated one under runs/ in the working directory.

    Raises:
        LogError: it holds a run already, or cannot be made.
    """
    path = wanted if wanted is not None else Path("runs") / f"{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    try:
        if RunDirectory(path).events.exists():
            raise LogError(f"{path}: --run: expected a new directory, this one holds a run already")
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LogError(f"{path}: --run: cannot be made: {error.strerror}") from error
    return path


def keep_site(path: Path, site: Mapping[str, object], files: Mapping[tuple[str, str], Path]) -> None:
    """Write site.toml so that the directory can be carried elsewhere: the files that it names lie beside it.

    Args:
        path: The run directory.
        site: The content of the site file.
        files: Its files by table and key, `area.0` being the first of several tables; one that comes with the program
            is not among them.
    """
    content = dict(site)
    for (name, key), file in files.items():
        name, _, number = name.partition(".")
        table = content[name]
        kept = f"{name}{number}{file.suffix}"
        if number and isinstance(table, list):
            content[name] = [{**one, key: kept} if str(row) == number else one for row, one in enumerate(table)]
        elif isinstance(table, Mapping):
            content[name] = {**table, key: kept}
        else:
            raise TypeError(f"the site's {name} is a table, or a list of them")
        shutil.copyfile(file, path / kept)
    write_whole(RunDirectory(path).site, tomli_w.dumps(content).encode())


def today() -> str:
    """Return the date here, as files have it."""
    return f"{datetime.now().astimezone():%Y-%m-%d}"


def write_json(path: Path, content: Mapping[str, object]) -> None:
    """Write a JSON file whole or not at all."""
    write_whole(path, (json.dumps(content, indent=1, allow_nan=False) + "\n").encode())


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold a run directory: of all processes on this computer one flies it.

    The lock is the system's, and ends with the process however it dies; a copy of the directory is not locked.

    Raises:
        LogError: another process holds it.
    """
    with RunDirectory(path).lock.open("a+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            file.seek(0)
            holder = file.read().strip()
            raise LogError(f"{path}: another faultline flies this directory already (process {holder})") from error
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        yield
