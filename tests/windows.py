"""Windows, as far as a program of Python meets it: what its modules lack there, and what fails."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import time
import warnings
from importlib import import_module
from multiprocessing import resource_tracker
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn, cast

OURS = ("executor", "faultline", "missions", "planner", "simulator")
OTHERS = (
    "concurrent.futures.process multiprocessing.connection multiprocessing.popen_spawn_posix multiprocessing.queues "
    "multiprocessing.synchronize fastapi jinja2 lxml numba numpy pydantic pymavlink.mavutil pyproj rich.console serial "
    "typer.main uvicorn"
)
"""What asks for the system when it is loaded."""
MISSING = "fcntl grp pty pwd readline resource syslog termios tty"
LACKS: dict[ModuleType, str] = {
    os: "fdatasync fork getloadavg getpgid getuid geteuid killpg mkfifo nice sched_getaffinity setsid statvfs sync "
    "O_CLOEXEC O_DIRECTORY O_NOFOLLOW",
    signal: "SIGALRM SIGHUP SIGPIPE SIGQUIT SIGUSR1 SIGUSR2 pause pthread_kill pthread_sigmask setitimer sigwait",
    time: "CLOCK_BOOTTIME CLOCK_MONOTONIC clock_gettime",
}


def pretend() -> None:
    """Make this process look like one on Windows, to packages of ours; processes that it starts do not."""
    for name in OTHERS.split():
        import_module(name)
    resource_tracker.ensure_running()  # as no process on Windows needs it
    cast("dict[str, None]", sys.modules).update(dict.fromkeys(MISSING.split()))
    for module, lacks in LACKS.items():
        for name in lacks.split():
            delattr(module, name)
    opens = os.open

    def open_file(path: Any, flags: int, *rest: Any, **named: Any) -> int:
        ours = sys._getframe(1).f_globals["__name__"].partition(".")[0] in OURS
        if ours and Path(path).is_dir():
            raise PermissionError(13, "Permission denied", str(path))
        return opens(path, flags, *rest, **named)

    def refuse(*_: object) -> NoReturn:
        raise NotImplementedError

    # Its files are read in the language's own encoding where none is named.
    warnings.filterwarnings("error", category=EncodingWarning, module=rf"({'|'.join(OURS)})\b")
    changed: tuple[tuple[object, str, object], ...] = (
        (os, "open", open_file),
        (asyncio.SelectorEventLoop, "add_signal_handler", refuse),
        (sys, "platform", "win32"),
    )
    for place, name, value in changed:
        setattr(place, name, value)
