"""MAVProxy, and a station that requests everything as QGroundControl does, with three real vehicles on one radio."""

from __future__ import annotations

import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.ports import free_ports
from tests.sitl.flights import Story, flown
from tests.sitl.real import ARDUPILOT, BOTH, Autopilot, RealVehicle
from tests.sitl.test_one_radio import replan_took_s
from tests.sitl.verdict import ended_well
from tests.stories.test_stations_beside import EVERY_S, Station

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(900)]

OURS = 254
RADIO, BYTES_S, WITHIN_S = "sik", 4000.0, 5.0


@BOTH
def test_one_is_lost_while_two_stations_look_on_and_one_asks_for_everything(
    autopilot: Autopilot, tmp_path: Path
) -> None:
    ports = free_ports(2)
    story = Story(
        RealVehicle.suspend, radius_m=400.0, speedup=1.0, radio=RADIO,
        settings={"MAV_GCS_SYSID": OURS} if autopilot is ARDUPILOT else {},
        tables={
            "link": {"one_radio": True, "bytes_s": BYTES_S, "station_sysid": OURS},
            "forward": {"to": [f"udpout://127.0.0.1:{port}" for port in ports], "allow_orders": True},
        },
    )  # fmt: skip
    with mavproxy(ports[0], tmp_path) as told, asking(ports[1]) as seen:
        flight = flown(autopilot, story, tmp_path)
    took_s = replan_took_s(flight)
    print(
        f"{autopilot.name}: on board of all survivors {took_s:.1f} s after the solver's answer; {len(seen)} datagrams"
    )
    print("\n".join(line for line in flight.said.splitlines() if "forward" in line or "radio" in line))
    ended_well(flight, ["link"], down=("uav1", "uav3"))
    assert len(flight.report["replans"]) == 1, flight.said
    assert flight.report["not_counted"] == []
    assert took_s <= WITHIN_S
    for system in (1, 2, 3):
        assert f"Detected vehicle {system}:1" in told.read_text(errors="replace"), "MAVProxy sees all of them"
    assert seen
    assert "requests streams, all parameters" in flight.said, "it is held back, and the crew is told"


@contextmanager
def mavproxy(port: int, folder: Path) -> Iterator[Path]:
    """Run MAVProxy behind a port; yields the file of what it says."""
    said = folder / "mavproxy.txt"
    command = [
        sys.executable, "-u", str(Path(sys.executable).with_name("mavproxy.py")),
        f"--master=udpin:127.0.0.1:{port}", "--default-modules=mode,cmdlong", "--state-basedir=.",
    ]  # fmt: skip
    pipe = subprocess.PIPE  # it ends where its standard input does
    with (
        said.open("wb") as file,
        subprocess.Popen(command, cwd=folder, stdin=pipe, stdout=file, stderr=subprocess.STDOUT) as process,
    ):
        try:
            yield said
        finally:
            process.kill()


@contextmanager
def asking(port: int) -> Iterator[list[int]]:
    """Ask for everything four times a second, as soon as somebody calls; yields the lengths of what comes."""
    seen, over = list[int](), threading.Event()

    def ask() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plug:
            plug.bind(("127.0.0.1", port))
            plug.settimeout(EVERY_S)
            callers = list[tuple[str, int]]()

            def say(frame: bytes) -> None:
                plug.sendto(frame, callers[-1])

            station = Station(say, (1, 2, 3))
            while not over.is_set():
                try:
                    data, caller = plug.recvfrom(65536)
                except TimeoutError:
                    continue
                callers.append(caller)
                seen.append(len(data))
                if len(seen) % 40 == 1:  # some tens of frames come every second
                    station.ask_everything()

    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    try:
        yield seen
    finally:
        over.set()
        thread.join()
