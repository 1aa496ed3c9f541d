"""The run directory: everything that one flight leaves, and its JSON documents as models."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from itertools import count
from pathlib import Path
from typing import Annotated, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from executor.errors import LogError
from missions import format_first_error
from missions.files import write_document


class _File:
    """A file of a run directory, which always has the same name."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, run: RunDirectory, kind: type[RunDirectory]) -> Path:
        return run.path / self._name


@dataclass(frozen=True, slots=True)
class RunDirectory:
    """Where each file of one flight lies; which of them are there depends on how far it came."""

    path: Path

    site = _File("site.toml")
    """The site file that it was flown with."""
    events = _File("events.jsonl")
    """The event log, from which everything else can be had again."""
    vehicles = _File("vehicles.json")
    """Who stood where, and what was on board, before the launch."""
    parameters = _File("parameters.json")
    """What was changed on board, and is to be given back."""
    fences = _File("fences.json")
    """The fences and rally points that were replaced on board, and are to be given back."""
    report = _File("report.json")
    """What the flight came to."""
    learned = _File("learned.json")
    """What the flight taught about its vehicles."""
    learned_before = _File("learned-before.json")
    """What was known of them before it; not there if nothing was."""
    page = _File("report.html")
    """The report to be read by people."""
    profile = _File("profile.png")
    """The first plan from the side; not there if no raster knew the ground."""
    battery = _File("battery.png")
    """The picture of the batteries."""
    terrain = _File("terrain.npz")
    """The ground that it was flown over; not there if no raster knew it."""
    next_sortie = _File("next-sortie.json")
    """The plan of what was left over."""
    day_plan = _File("day-plan.json")
    """The day plan that it was flown by; not there for a single flight."""
    packs = _File("packs.json")
    """What its packs gave; not there if none was changed."""
    truths = _File("truth.jsonl")
    """What a simulated fleet notes: what really happened, and when."""
    lock = _File(".lock")
    """The file that is locked while the directory is flown."""
    images_csv = _File("images.csv")
    """The pictures of the flight, as a table."""
    images_geojson = _File("images.geojson")
    """The same with the assets, for maps."""
    images_sqlite = _File("images.sqlite")
    """The same as tables, which the files of the cards are matched to."""
    images_files = _File("images-files.csv")
    """Which file is which picture."""
    assets = _File("assets.html")
    """The page of every asset with its pictures."""

    @property
    def checkpoints(self) -> tuple[Path, Path]:
        """Return the last two checkpoints: while one is written, the other is whole."""
        return self.path / "checkpoint-a.jsonl", self.path / "checkpoint-b.jsonl"

    def plan_path(self, revision: int) -> Path:
        """Return a plan: the first is 0, every re-plan one more."""
        return self.path / f"plan-{revision:03d}.json"

    def telemetry_path(self, vehicle: str, link: int = 1) -> Path:
        """Return the telemetry log of a vehicle's first, second ... link; a long one has further parts beside it."""
        return self.path / (f"{vehicle}.tlog" if link == 1 else f"{vehicle}.link{link}.tlog")


def name_run(runs: Path) -> Path:
    """Return a dated directory that is not there yet."""
    begun = f"{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    names = (begun if number == 1 else f"{begun}-{number}" for number in count(1))
    return next(runs / name for name in names if not (runs / name).exists())


def create_run_directory(wanted: Path | None) -> Path:
    """Make the directory of a run; by default a dated one under runs/ in the working directory.

    Raises:
        LogError: it holds a run already, or cannot be made; or nothing can be flown here.
    """
    path = wanted if wanted is not None else name_run(Path("runs"))
    check_can_fly(path)
    try:
        if RunDirectory(path).events.exists():
            raise LogError(f"{path}: --run: expected a new directory, this one holds a run already")
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LogError(f"{path}: --run: cannot be made: {error.strerror}") from error
    return path


def today() -> str:
    """Return the date here, as files have it."""
    return f"{datetime.now().astimezone():%Y-%m-%d}"


def check_can_fly(named: Path) -> None:
    """Check that this system can hold a run directory for one process, without which nothing is flown.

    Args:
        named: The file or directory that the refusal names.

    Raises:
        LogError: it cannot.
    """
    if sys.platform == "win32":
        raise LogError(
            f"{named}: expected Linux or macOS to fly, resume or restore, got Windows (use WSL 2); "
            "planning, checking and replays go without"
        )


@contextmanager
def lock_run_directory(path: Path) -> Iterator[None]:
    """Hold a run directory: of all processes on this computer one flies it.

    The lock is the system's, and ends with the process however it dies; a copy of the directory is not locked.

    Raises:
        LogError: another process holds it, or the system has no such locks: nothing is flown there.
    """
    check_can_fly(path)
    with hold_lock(RunDirectory(path).lock, f"{path}: another faultline flies this directory already"):
        yield


@contextmanager
def hold_lock(path: Path, taken: str) -> Iterator[None]:
    """Hold a file that one process holds at a time.

    Args:
        path: The file; it is made where it is missing.
        taken: What to say where another process holds it; which one is added.

    Raises:
        LogError: another process holds it.
        ImportError: the system has no such locks.
    """
    if sys.platform == "win32":
        raise ImportError("fcntl")
    import fcntl

    with path.open("a+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            file.seek(0)
            raise LogError(f"{taken} (process {file.read().strip()})") from error
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        yield


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Tenths = Annotated[Number, AfterValidator(partial(round, ndigits=1))]
Hundredths = Annotated[Number, AfterValidator(partial(round, ndigits=2))]
Thousandths = Annotated[Number, AfterValidator(partial(round, ndigits=3))]
Whole = Annotated[int, Field(strict=True)]
YesNo = Annotated[bool, Field(strict=True)]


class Document(BaseModel):
    """A JSON object; keys that it does not know, of a later version, are passed over."""

    model_config = ConfigDict(frozen=True)

    @classmethod
    def build_from(cls, source: object, **more: object) -> Self:
        """Return the document of a value.

        Args:
            source: What it has under the names of this document is taken as it is.
            more: What it does not have, or has in another form.
        """
        same = {name: getattr(source, name) for name in cls.model_fields if name not in more and hasattr(source, name)}
        return cls.model_validate({**same, **more})

    def to_plain(self) -> dict[str, object]:
        """Return it as JSON has it."""
        return self.model_dump(mode="json")

    def write(self, path: Path) -> None:
        """Write it, whole or not at all.

        Raises:
            OSError: it cannot be written.
        """
        write_document(path, self.to_plain())

    @classmethod
    def read(cls, path: Path, expected: str) -> Self:
        """Read it.

        Args:
            path: Its file.
            expected: What it is, in words.

        Raises:
            LogError: one line that names the file, the key and what was expected.
        """
        try:
            return cls.model_validate_json(path.read_bytes())
        except OSError as error:
            raise LogError(f"{path}: cannot be read: {error.strerror}; expected {expected}") from error
        except ValidationError as error:
            raise LogError(f"{path}: {format_first_error(error)}") from error
