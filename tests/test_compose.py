"""docker-compose.yml and its files, checked against its specification and our rules: no engine runs here."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
import time
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import jsonschema
import pytest

from executor.site.site_file import read_site
from simulator import common_time
from tests.composed import ROOT, UnsetVariable, _resolved, composed, services, words
from tests.patience import PATIENCE_S
from tests.sitl.real import COPTER_PARAMETERS

PROFILES = ("demo", "px4", "ardupilot")
OURS = "faultline"
DOCKER = ROOT / "docker"


def schema() -> dict[str, Any]:
    """Return the compose specification's schema, as check-jsonschema carries it."""
    text = files("check_jsonschema").joinpath("builtin_schemas", "vendor", "compose-spec.json").read_text("utf-8")
    content: dict[str, Any] = json.loads(text)
    return content


def test_the_file_keeps_to_the_compose_specification() -> None:
    jsonschema.validate(composed(), schema())


@pytest.mark.parametrize(
    "spoil",
    [
        lambda file: file["services"]["fleet"].update(imagee="x"),
        lambda file: file["services"]["fleet"]["healthcheck"].update(retries=[]),
        lambda file: file["services"]["fleet"]["depends_on"]["site-demo"].update(condition="ready"),
    ],
)
def test_the_schema_notices_a_mistake(spoil: Any) -> None:
    file = composed()
    spoil(file)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(file, schema())


def test_variables_are_resolved_as_an_engine_does() -> None:
    text = ["${N:-4} of $$i", "a${N:-}b"]
    assert _resolved(text, {}) == ["4 of $i", "ab"]
    assert _resolved(text, {"N": "7"}) == ["7 of $i", "a7b"]
    with pytest.raises(UnsetVariable):
        _resolved("${N}", {})


def test_one_variable_sets_the_number_of_vehicles_everywhere() -> None:
    for profile in PROFILES:
        site = services(profile, {"FAULTLINE_VEHICLES": "9"})[f"site-{profile}"]
        assert site["command"][site["command"].index("--vehicles") + 1] == "9"


@pytest.mark.parametrize("profile", PROFILES)
def test_a_profile_is_whole(profile: str) -> None:
    found = services(profile)
    assert {"broker", f"site-{profile}", f"executor-{profile}"} < set(found)
    volumes, networks = composed()["volumes"], composed()["networks"]
    for name, service in found.items():
        assert set(service.get("depends_on", {})) <= set(found), f"{name} waits for a service of another profile"
        for waited_for, how in service.get("depends_on", {}).items():
            if how["condition"] == "service_healthy":
                assert "healthcheck" in found[waited_for], f"{name} waits for the health of {waited_for}"
        assert service.get("networks") == ["fleet"] or service["network_mode"] == "service:fleet"
        for mount in service.get("volumes", []):
            source = mount.split(":")[0]
            assert source in volumes or (ROOT / source).exists(), f"{name}: {mount}"
    assert set(networks) == {"fleet"}


def test_every_service_that_stays_has_a_health_check() -> None:
    for name, service in composed()["services"].items():
        assert ("healthcheck" in service) is not name.startswith("site-"), name


def test_no_port_is_open_beyond_this_computer() -> None:
    ports = {name: service["ports"] for name, service in composed()["services"].items() if "ports" in service}
    page = {name: ["127.0.0.1:8080:8080"] for name in ("fleet", "executor-px4", "executor-ardupilot")}
    assert ports == {"broker": ["127.0.0.1:1883:1883"], **page}


def test_only_the_simulated_fleets_network_is_shared_for_its_time_is_kept_there() -> None:
    shared = {
        name: service["network_mode"] for name, service in composed()["services"].items() if "network_mode" in service
    }
    assert shared == {"executor-demo": "service:fleet"}
    [vehicle] = read_site(DOCKER / "demo.toml").vehicle
    assert urlsplit(str(vehicle.link)).hostname == common_time.HERE
    assert waited_for(services("demo"), "executor-demo") >= {"fleet", "broker"}


def test_one_service_builds_the_image_and_the_others_wait_for_it() -> None:
    for profile in PROFILES:
        found, site = services(profile), f"site-{profile}"
        built = {name for name, service in found.items() if "build" in service}
        assert built == {site, *({"ardupilot"} & set(found))}
        assert len({found[name]["image"] for name in built}) == len(built), "a tag that is built twice"
        ours = {name: one for name, one in found.items() if one["image"] == found[site]["image"] and name != site}
        assert f"executor-{profile}" in ours
        for name, service in ours.items():
            assert service["pull_policy"] == "never", name
            assert site in waited_for(found, name), name


def waited_for(found: dict[str, Any], name: str) -> set[str]:
    """Return all services that one begins after."""
    first = set(found[name].get("depends_on", {}))
    return first.union(*(waited_for(found, one) for one in first))


def test_without_a_profile_the_demo_is_started() -> None:
    lines = (ROOT / ".env").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if not line.startswith("#")] == ["COMPOSE_PROFILES=demo"]


@pytest.mark.parametrize("profile", PROFILES)
def test_the_page_is_at_the_address_that_is_printed(profile: str, tmp_path: Path) -> None:
    found = services(profile, {"FAULTLINE_WEB_PORT": "8123", "FAULTLINE_WEB_TOKEN": "a-token-of-the-crew"})
    site, executor = found[f"site-{profile}"], found[f"executor-{profile}"]
    command = [str(DOCKER / f"{profile}.toml"), *site["command"][1:-2], "--into", str(tmp_path)]
    done = subprocess.run(
        [sys.executable, str(DOCKER / "prepare.py"), *command], cwd=ROOT, env={**os.environ, **site["environment"]},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.splitlines()[-1].endswith(": http://127.0.0.1:8123/?token=a-token-of-the-crew")
    web = read_site(tmp_path / "site.toml").web
    assert (web.host, web.address) == ("0.0.0.0", "http://127.0.0.1:8123/")  # noqa: S104 - in its container
    published = found[executor.get("network_mode", "service:").removeprefix("service:") or f"executor-{profile}"]
    assert published["ports"] == [f"127.0.0.1:8123:{web.port}"]
    assert executor["environment"][web.token_env] == "a-token-of-the-crew"


def test_every_executor_keeps_its_runs_on_the_volume() -> None:
    dockerfile = (DOCKER / "Dockerfile").read_text(encoding="utf-8")
    assert re.search(r"^WORKDIR /$", dockerfile, re.MULTILINE), "fly writes to runs/ in its working directory"
    for profile in PROFILES:
        assert "runs:/runs" in services(profile)[f"executor-{profile}"]["volumes"]


def test_the_image_is_locked_and_runs_without_root() -> None:
    lines = (DOCKER / "Dockerfile").read_text(encoding="utf-8").splitlines()
    assert "FROM ${PYTHON}" in lines
    assert "RUN pip install --require-hashes -r requirements.lock" in lines
    user = next(line for line in lines if line.startswith("USER "))
    assert user != "USER root"
    assert lines.index(user) < lines.index('ENTRYPOINT ["faultline"]')
    copied = [line.split()[1:-1] for line in lines if line.startswith("COPY ")]
    allowed = (ROOT / ".dockerignore").read_text(encoding="utf-8").split()
    for source in (name for names in copied for name in names):
        assert (ROOT / source).exists(), source
        assert f"!{source}" in allowed, f"{source} is not sent to the engine"


def test_what_is_fetched_is_known_by_its_digest_or_tag() -> None:
    digest = r"@sha256:[0-9a-f]{64}"
    for name in ("Dockerfile", "ardupilot.Dockerfile"):
        text = (DOCKER / name).read_text(encoding="utf-8")
        assert re.findall(r"^ARG PYTHON=(\S+)$", text, re.MULTILINE), name
        assert re.search(rf"^ARG PYTHON=python:3\.11-slim{digest}$", text, re.MULTILINE), name
        assert re.findall(r"^FROM (\S+)", text, re.MULTILINE) == ["${PYTHON}"]
    added = re.findall(r"^ADD ((?:.*\\\n)*.*)$", text, re.MULTILINE)
    assert len(added) == 1
    assert re.search(r"--checksum=sha256:[0-9a-f]{64} ", added[0])
    assert "/Copter/stable-4." in added[0]
    services = composed()["services"]
    assert re.fullmatch(rf"eclipse-mosquitto:2\S*{digest}", services["broker"]["image"])
    assert services["px4"]["image"] == "px4io/px4-sitl:v1.17.0"  # of which no document tells a digest


@pytest.mark.parametrize("profile", PROFILES)
def test_the_site_names_its_services(profile: str) -> None:
    [vehicle] = read_site(DOCKER / f"{profile}.toml").vehicle
    url = urlsplit(str(vehicle.link))
    if url.scheme == "udpout" and profile != "demo":  # whose fleet is on its executor's own network
        assert url.hostname in services(profile)
    told = " ".join(word for service in services(profile).values() for word in words(service))
    if profile != "px4":  # whose ports are its own
        assert str(url.port) in told


def prepare(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(DOCKER / "prepare.py"), *arguments, "--into", str(folder)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=PATIENCE_S)


def test_a_fleet_is_made_from_one_vehicle(tmp_path: Path) -> None:
    done = prepare(tmp_path, str(DOCKER / "px4.toml"), "--vehicles", "12", "--speedup", "2")
    assert done.returncode == 0, done.stderr
    site = read_site(tmp_path / "site.toml")
    assert [one.connection for one in site.vehicle[::11]] == ["udpout://px4:14580", "udpout://px4:14591"]
    assert [(one.name, one.sysid) for one in site.vehicle[:2]] == [("uav1", 1), ("uav2", 2)]
    assert site.flight.speedup == 2.0
    pads = (tmp_path / "pads").read_text(encoding="utf-8").splitlines()
    assert len(set(pads)) == 12
    assert all(len(pad.split()) == 3 for pad in pads)


def test_a_fleet_that_cannot_be_made_is_refused_in_one_line(tmp_path: Path) -> None:
    done = prepare(tmp_path, str(DOCKER / "px4.toml"), "--vehicles", "0")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "expected at least one vehicle" in done.stderr


def healthy(*arguments: str) -> bool:
    return subprocess.run([sys.executable, str(DOCKER / "healthy.py"), *arguments], check=False).returncode == 0


def test_a_port_is_healthy_while_a_process_listens() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plug:
        plug.bind(("127.0.0.1", 0))
        port = str(plug.getsockname()[1])
        assert healthy("port", port)
    assert not healthy("port", port)


def test_a_port_check_never_occupies_the_port() -> None:
    """Simulated vehicles that started in the moment of the question would find it in use, and end."""
    hook = "lambda event, _: sys.exit('it is taken') if event == 'socket.bind' else None"
    program = f"import runpy, sys; sys.addaudithook({hook}); runpy.run_path(sys.argv[0], run_name='__main__')"
    asked = [sys.executable, "-c", f"import sys; sys.argv = {[str(DOCKER / 'healthy.py'), 'port', '9']}; {program}"]
    result = subprocess.run(asked, check=False, capture_output=True, text=True)
    assert (result.returncode, result.stderr) == (1, "")


def test_a_run_is_healthy_while_its_events_continue(tmp_path: Path) -> None:
    assert not healthy("run", str(tmp_path))
    for name, began_s in (("a", time.time() - 3600), ("b", time.time())):
        (tmp_path / name).mkdir()
        for file in ("site.toml", "events.jsonl"):
            path = tmp_path / name / file
            path.touch()
            _age(path, began_s)
    assert healthy("run", str(tmp_path))
    _age(tmp_path / "b" / "events.jsonl", time.time() - 60)
    assert not healthy("run", str(tmp_path))
    (tmp_path / "b" / "events.jsonl").unlink()
    assert healthy("run", str(tmp_path)), "before its flight"


def _age(path: Path, at_s: float) -> None:
    os.utime(path, (at_s, at_s))


def test_the_copters_parameters_are_those_that_the_tests_fly_with() -> None:
    lines = (DOCKER / "copter.parm").read_text(encoding="utf-8").splitlines()
    values = {name: float(value) for name, value in (line.split() for line in lines if not line.startswith("#"))}
    assert values == {**COPTER_PARAMETERS, "FS_GCS_ENABLE": 1}


@pytest.mark.parametrize("name", ["px4", "ardupilot"])
def test_the_simulators_scripts_are_shell(name: str) -> None:
    service = composed()["services"][name]
    for script in (service["command"][0], service["healthcheck"]["test"][1]):
        checked = subprocess.run(["/bin/sh", "-n", "-c", script], capture_output=True, text=True, check=False)
        assert checked.returncode == 0, checked.stderr


def test_the_px4_script_starts_an_instance_for_each_pad(tmp_path: Path) -> None:
    """Run as it is, with a stand-in for the binary and the pads of three vehicles."""
    assert prepare(tmp_path, str(DOCKER / "px4.toml"), "--vehicles", "3").returncode == 0
    started = _run_script("px4", "px4", tmp_path)
    pads = (tmp_path / "pads").read_text(encoding="utf-8").split("\n")
    assert sorted(started) == [f"-d -i {number} at {pads[number]}" for number in range(3)]


def test_the_ardupilot_script_starts_an_instance_for_each_pad(tmp_path: Path) -> None:
    assert prepare(tmp_path, str(DOCKER / "ardupilot.toml"), "--vehicles", "2").returncode == 0
    started = sorted(_run_script("ardupilot", "arducopter", tmp_path))
    ports = [urlsplit(str(one.link)).port for one in read_site(tmp_path / "site.toml").vehicle]
    assert ports == [16000, 16001]
    for number, line in enumerate(started):
        assert f"--sysid {number + 1} --serial0 udpclient:10.1.2.3:{ports[number]} " in line
        assert line.startswith(f"-I {number} ")


def _run_script(service: str, binary: str, folder: Path) -> list[str]:
    """Run a simulator's script with a stand-in that writes down how it was called."""
    tools, log = folder / "bin", folder / "started"
    tools.mkdir()
    for name, text in {
        binary: f'#!/bin/sh\necho "$* at $PX4_HOME_LAT $PX4_HOME_LON $PX4_HOME_ALT" >> {log}\n',
        "getent": '#!/bin/sh\necho "10.1.2.3 executor-ardupilot"\n',
    }.items():
        (tools / name).write_text(text, encoding="utf-8")
        (tools / name).chmod(0o755)
    script = composed()["services"][service]["command"][0]
    script = script.replace("/site/", f"{folder}/").replace("/tmp/copter", f"{folder}/copter")
    environment = {"PATH": f"{tools}:/usr/bin:/bin", "SPEEDUP": "1"}
    subprocess.run(["/bin/sh", "-ec", script], env=environment, check=True, timeout=PATIENCE_S)
    return log.read_text(encoding="utf-8").splitlines()
