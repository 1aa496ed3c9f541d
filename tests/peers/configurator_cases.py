"""What ArduPilot's methodic configurator, without its windows, can do with a vehicle."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

from tests.peers.judging import Subject, Suite
from tests.peers.mavproxy_cases import NOTE

NAME = "FS_GCS_TIMEOUT"


@dataclass(frozen=True, slots=True)
class Bench:
    """The configurator's flight controller, connected."""

    subject: Subject
    controller: Any

    def order(self, name: str, *arguments: object) -> None:
        """Call what returns whether it succeeded, and why not."""
        done, why = getattr(self.controller, name)(*arguments)
        assert done, why


@asynccontextmanager
async def connected(subject: Subject) -> AsyncIterator[Bench]:
    """Connect as its main window does."""
    from ardupilot_methodic_configurator.backend_flightcontroller import FlightController

    controller = await asyncio.to_thread(FlightController, network_ports=[])
    try:
        assert not (fault := await asyncio.to_thread(controller.connect, subject.listen())), fault
        yield Bench(subject, controller)
    finally:
        await asyncio.to_thread(controller.disconnect)


def identify(at: Bench) -> None:
    info = at.controller.info
    assert info.vehicle_type == "ArduCopter", info.vehicle_type
    assert info.is_mavftp_supported


def read_parameters(at: Bench) -> None:
    values, usual = at.controller.download_params(
        None, at.subject.folder / "all.parm", at.subject.folder / "usual.parm"
    )
    assert NAME in values
    assert NAME in usual
    at.subject.prove(lambda now: values.keys() == now.parameters.keys())


def set_parameter(at: Bench) -> None:
    at.order("set_param", NAME, 33.5)
    assert at.controller.fetch_param(NAME) == 33.5
    at.subject.prove(lambda now: now.parameters[NAME] == 33.5)


def read_battery(at: Bench) -> None:
    at.controller.download_params(None, at.subject.folder / "all.parm", at.subject.folder / "usual.parm")
    at.order("request_periodic_battery_status")
    statuses, why = at.controller.get_battery_statuses()
    assert statuses, why


def by_files(*orders: tuple[str, ...]) -> Callable[[Bench], None]:
    """Return a case: orders about files that are all to succeed, after one was put on board."""

    def case(at: Bench) -> None:
        (local := at.subject.folder / "note.txt").write_text(NOTE, encoding="ascii")
        for name, *words in (("upload_file", str(local), "/note.txt"), *orders):
            filled = [word.replace("LOCAL", str(at.subject.folder)) for word in words]
            assert getattr(at.controller, name)(*filled), f"{name} {words} failed"

    return case


def list_files(at: Bench) -> None:
    by_files()(at)
    found = at.controller.list_remote_files("/")
    assert found is not None
    assert "note.txt" in {one.name for one in found}


def turn_motor(at: Bench) -> None:
    at.order("test_motor", 0, "A", 1, 5, 1)


def calibrate_level(at: Bench) -> None:
    at.order("start_accel_calibration_simple")


def forget_parameters(at: Bench) -> None:
    at.order("reset_all_parameters_to_default")


SUITES = {
    "methodic configurator": Suite("ardupilot-methodic-configurator", connected, {
        "identify": identify, "read all parameters": read_parameters, "set a parameter": set_parameter,
        "read the battery": read_battery, "upload a file": by_files(), "list files": list_files,
        "download a file": by_files(("download_remote_file", "/note.txt", "LOCAL/back.txt")),
        "compare a file": by_files(("verify_remote_file", "/note.txt", "LOCAL/note.txt")),
        "rename a file": by_files(("rename_remote_path", "/note.txt", "/other.txt")),
        "remove a file": by_files(("delete_remote_path", "/note.txt")),
        "make a folder": by_files(("make_remote_directory", "/folder")), "turn a motor": turn_motor,
        "calibrate the accelerometer": calibrate_level, "reset all parameters": forget_parameters,
    }, ("ardupilot",)),
}  # fmt: skip
