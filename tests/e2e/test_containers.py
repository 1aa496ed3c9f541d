"""The profiles of docker-compose.yml on a real engine, in containers; `./scripts/containers` makes the images first."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.composed import ROOT
from tests.patience import PATIENCE_S
from tests.ports import free_port

VEHICLES = 3
FLIGHT_S = 3600
IMAGES = {
    "demo": "localhost/faultline",
    "px4": "docker.io/px4io/px4-sitl:v1.17.0",
    "ardupilot": "localhost/arducopter",
}
pytestmark = pytest.mark.campaign


class Engine:
    """podman-compose with one profile."""

    def __init__(self, profile: str) -> None:
        self.profile = profile
        self.environment = {
            **os.environ,
            "COMPOSE_PROFILES": profile,
            "COMPOSE_PROJECT_NAME": f"faultline-{profile}",
            "FAULTLINE_VEHICLES": str(VEHICLES),
            "FAULTLINE_MQTT_PORT": str(free_port()),
            "FAULTLINE_WEB_PORT": str(free_port()),
            "FAULTLINE_ARDUPILOT_IMAGE": IMAGES["ardupilot"],
            "FAULTLINE_BROKER_IMAGE": "docker.io/library/eclipse-mosquitto:2",
        }

    def compose(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Call podman-compose."""
        return subprocess.run(
            ["podman-compose", *words], cwd=ROOT, env=self.environment, text=True,
            stdin=subprocess.DEVNULL, capture_output=True, timeout=FLIGHT_S + 60, check=False,
        )  # fmt: skip

    def container(self, service: str) -> str:
        """Return the name of a service's container."""
        return f"faultline-{self.profile}_{service}_1"

    @property
    def executor(self) -> str:
        """The container that flies."""
        return self.container(f"executor-{self.profile}")

    def read_page_address(self) -> str:
        """Return the page's address, as the site's service prints it."""
        address: str
        [address] = set(re.findall(r"http://\S+", podman("logs", self.container(f"site-{self.profile}"))))
        return address

    def report(self, into: Path) -> dict[str, Any]:
        """Return the report of the one flight on the volume."""
        podman("volume", "export", f"faultline-{self.profile}_runs", "--output", str(into / "runs.tar"))
        shutil.unpack_archive(into / "runs.tar", into)
        [found] = into.glob("*/report.json")
        report: dict[str, Any] = json.loads(found.read_text(encoding="utf-8"))
        return report


def podman(*words: str) -> str:
    """Call podman, and return what it prints."""
    done = subprocess.run(["podman", *words], capture_output=True, text=True, timeout=FLIGHT_S, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(params=IMAGES)
def engine(request: pytest.FixtureRequest) -> Iterator[Engine]:
    if shutil.which("podman-compose") is None:
        pytest.skip("no podman-compose: ./scripts/containers installs it, and makes the images")
    for image in (IMAGES["demo"], IMAGES[request.param]):
        if subprocess.run(["podman", "image", "exists", image], check=False).returncode != 0:
            pytest.skip(f"no image {image}: ./scripts/containers says how it is made")
    engine = Engine(request.param)
    engine.compose("down", "--volumes")
    yield engine
    engine.compose("down", "--volumes")


def test_a_profile_flies_to_its_end(engine: Engine, tmp_path: Path) -> None:
    # The executor's end is awaited, not that of all: simulators and the broker have none.
    up = engine.compose("up", "--detach", "--no-build")
    assert up.returncode == 0, up.stderr
    with httpx.Client(transport=httpx.HTTPTransport(retries=12), follow_redirects=True) as browser:  # until it is there
        assert "faultline" in browser.get(engine.read_page_address(), timeout=PATIENCE_S).text
    heard = ("mosquitto_sub", "-t", "faultline/v1/#", "-C", "1", "-F", "%t")
    assert podman("exec", engine.container("broker"), *heard).startswith("faultline/v1/")
    code = podman("wait", engine.executor).strip()
    said = podman("logs", engine.executor)
    assert code == "0", said[-4000:]
    report = engine.report(tmp_path)
    assert report["finished"]
    assert report["segments_inspected"] == report["segments_total"]
    assert len(report["vehicles"]) == VEHICLES
    assert {fault["vehicle"] for fault in report["faults"]} == ({"uav2"} if engine.profile == "demo" else set())
    print(f"{engine.profile}: {report['segments_inspected']} segments in {report['duration_s']:.0f} s")
