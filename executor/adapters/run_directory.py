"""The run directory: all files of one flight, and its JSON documents as models."""

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
from typing import IO, Annotated, Any, ClassVar, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from executor.errors import LogError
from missions import format_first_error
from missions.files import write_document


class _File:
    """A file of a run directory with a fixed name."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, run: RunDirectory, kind: type[RunDirectory]) -> Path:
        return run.path / self._name


@dataclass(frozen=True, slots=True)
class RunDirectory:
    """Paths of one flight's files; which of them exist depends on how far the flight got."""

    path: Path

    site = _File("site.toml")
    """Site file of the flight."""
    events = _File("events.jsonl")
    """Event log, from which everything else can be rebuilt."""
    vehicles = _File("vehicles.json")
    """Positions and state on board of every vehicle before the launch."""
    parameters = _File("parameters.json")
    """Parameters changed on board, to be restored."""
    fences = _File("fences.json")
    """Fences and rally points replaced on board, to be restored."""
    report = _File("report.json")
    """Results of the flight."""
    learned = _File("learned.json")
    """Values learned about the vehicles."""
    learned_before = _File("learned-before.json")
    """Values known before the flight; absent if none."""
    page = _File("report.html")
    """Report for people."""
    profile = _File("profile.png")
    """Height profile of the first plan; absent without terrain data."""
    battery = _File("battery.png")
    """Battery chart."""
    terrain = _File("terrain.npz")
    """Terrain below the flight; absent without terrain data."""
    next_sortie = _File("next-sortie.json")
    """Plan for the segments left over."""
    day_plan = _File("day-plan.json")
    """Day plan; absent for a single flight."""
    packs = _File("packs.json")
    """Measurements of battery packs; absent if none was changed."""
    truths = _File("truth.jsonl")
    """Ground truth of a simulated fleet."""
    lock = _File(".lock")
    """Lock file, held during the flight."""
    images_csv = _File("images.csv")
    """Pictures of the flight as a table."""
    images_geojson = _File("images.geojson")
    """Pictures and assets for maps."""
    images_sqlite = _File("images.sqlite")
    """Pictures as tables, to match the files of memory cards."""
    images_files = _File("images-files.csv")
    """Match of files to pictures."""
    assets = _File("assets.html")
    """The page of every asset with its pictures."""

    @property
    def checkpoints(self) -> tuple[Path, Path]:
        """Return the last two checkpoints; while one is written, the other is whole."""
        return self.path / "checkpoint-a.jsonl", self.path / "checkpoint-b.jsonl"

    def plan_path(self, revision: int) -> Path:
        """Return the path of a plan: the first is 0, each re-plan adds one."""
        return self.path / f"plan-{revision:03d}.json"

    def telemetry_path(self, vehicle: str, link: int = 1) -> Path:
        """Return the telemetry log of a vehicle's first, second ... link; a long one has further parts next to it."""
        return self.path / (f"{vehicle}.tlog" if link == 1 else f"{vehicle}.link{link}.tlog")


def name_run(runs: Path) -> Path:
    """Return a dated directory that does not exist yet."""
    begun = f"{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    names = (begun if number == 1 else f"{begun}-{number}" for number in count(1))
    return next(runs / name for name in names if not (runs / name).exists())


def create_run_directory(wanted: Path | None) -> Path:
    """Create the directory of a run; by default a dated one under runs/ in the working directory.

    Raises:
        LogError: It holds a run already, or cannot be created; or this system cannot fly.
    """
    check_run_directory(wanted)
    path = wanted if wanted is not None else name_run(Path("runs"))
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LogError(f"{path}: --run: cannot be made: {error.strerror}") from error
    return path


def check_run_directory(wanted: Path | None) -> None:
    """Check, before a long computation, that a run can be recorded in a directory; nothing is created.

    Raises:
        LogError: It holds a run already, or this system cannot fly.
    """
    check_can_fly(wanted or Path("runs"))
    if wanted is not None and RunDirectory(wanted).events.exists():
        raise LogError(f"{wanted}: --run: expected a new directory, this one holds a run already")


def today() -> str:
    """Return the local date, as used in file names."""
    return f"{datetime.now().astimezone():%Y-%m-%d}"


def check_can_fly(named: Path) -> None:
    """Check that this system can lock a run directory for one process; a flight needs that.

    Args:
        named: File or directory to name in the error.

    Raises:
        LogError: It cannot.
    """
    if sys.platform == "win32":
        raise LogError(
            f"{named}: expected Linux or macOS to fly, resume or restore, got Windows (use WSL 2); "
            "planning, checking and replays go without"
        )


@contextmanager
def lock_run_directory(path: Path) -> Iterator[None]:
    """Lock a run directory, so that only one process on this computer flies it.

    The lock is the system's, and ends with the process however it dies; a copy of the directory is not locked.

    Raises:
        LogError: Another process holds it, or the system lacks file locks, without which flights are refused.
    """
    check_can_fly(path)
    with hold_lock(RunDirectory(path).lock, f"{path}: another faultline flies this directory already"):
        yield


@contextmanager
def hold_lock(path: Path, taken: str) -> Iterator[None]:
    """Lock a file that one process holds at a time.

    Args:
        path: The file; it is created if missing.
        taken: Error text if another process holds it; that process is added.

    Raises:
        LogError: Another process holds it.
        ImportError: The system lacks file locks.
    """
    with path.open("a+") as file:
        try:
            lock_file(file)
        except OSError as error:
            file.seek(0)
            raise LogError(f"{taken} (process {file.read().strip()})") from error
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        yield


def lock_file(file: IO[Any]) -> None:
    """Lock an open file for this process; closing the file unlocks it.

    Raises:
        BlockingIOError: Another process holds it.
        ImportError: The system lacks file locks.
    """
    if sys.platform == "win32":
        raise ImportError("fcntl")
    import fcntl

    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Tenths = Annotated[Number, AfterValidator(partial(round, ndigits=1))]
Hundredths = Annotated[Number, AfterValidator(partial(round, ndigits=2))]
Thousandths = Annotated[Number, AfterValidator(partial(round, ndigits=3))]
Whole = Annotated[int, Field(strict=True)]
YesNo = Annotated[bool, Field(strict=True)]


class Document(BaseModel):
    """A JSON object; unknown keys, of a later version, are ignored."""

    model_config = ConfigDict(frozen=True, defer_build=True, from_attributes=True)

    expected: ClassVar[str]
    """Description of the file in words, for errors on reading."""

    @classmethod
    def build_from(cls, source: object, **more: object) -> Self:
        """Build the document from a value.

        Args:
            source: Its attributes with the names of this document's fields are copied, those of its parts too.
            more: Fields that it lacks, or has in another form.
        """
        same = {name: getattr(source, name) for name in cls.model_fields if name not in more and hasattr(source, name)}
        return cls.model_validate({**same, **more})

    def to_plain(self) -> dict[str, object]:
        """Return the document as plain JSON data."""
        return self.model_dump(mode="json")

    def write(self, path: Path) -> None:
        """Write the document, whole or not at all.

        Raises:
            OSError: It cannot be written.
        """
        write_document(path, self.to_plain())

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read the document from its file.

        Raises:
            LogError: One line that names the file, the key and what was expected.
        """
        try:
            return cls.model_validate_json(path.read_bytes())
        except OSError as error:
            raise LogError(f"{path}: cannot be read: {error.strerror}; expected {cls.expected}") from error
        except ValidationError as error:
            raise LogError(f"{path}: {format_first_error(error)}") from error
