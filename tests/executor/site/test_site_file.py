"""The site file: every refusal is one line that names the file, the key and what was expected."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from executor.core.interface.connection import EXPECTED
from executor.errors import SiteError
from executor.site.site_file import Site, check_site, read_secret, read_signing_key, read_site

Content = dict[str, Any]


def vehicle(number: int = 1, **changes: object) -> Content:
    table: Content = {
        "name": f"uav{number}",
        "connection": f"udpin://127.0.0.1:{14550 + number}",
        "sysid": number,
        "autopilot": "ardupilot",
    }
    return table | changes


def content(*vehicles: Content, **tables: object) -> Content:
    base: Content = {
        "depot": {"lat_deg": 49.6, "lon_deg": 15.6, "alt_m": 450.0},
        "network": {"file": "line.geojson"},
        "vehicle": list(vehicles) or [vehicle(1), vehicle(2)],
    }
    return base | tables


def reason(wrong: Content) -> str:
    with pytest.raises(SiteError) as raised:
        check_site(wrong, "site.toml")
    text = str(raised.value)
    assert "\n" not in text
    assert text.startswith("site.toml: ")
    return text.removeprefix("site.toml: ")


def test_a_good_site_and_its_defaults() -> None:
    site = check_site(content(), "site.toml")
    assert [table.name for table in site.vehicle] == ["uav1", "uav2"]
    assert (site.vehicle[0].budget_pct, site.vehicle[0].reserve_pct) == (75.0, 15.0)
    assert (site.inspection.speed_m_s, site.inspection.corridor_m, site.flight.speedup) == (3.0, 10.0, 1.0)
    assert site.flight.fly_again == "ask"


def test_wind_is_two_numbers_for_where_the_air_moves() -> None:
    assert check_site(content(), "site.toml").inspection.wind_m_s == (0.0, 0.0)
    windy = content(inspection={"wind_m_s": [4.0, -2.5]})
    assert check_site(windy, "site.toml").inspection.wind_m_s == (4.0, -2.5)
    assert reason(content(inspection={"wind_m_s": [4.0]})).startswith("inspection.wind_m_s[1]: expected")
    assert reason(content(inspection={"wind_m_s": [40.0, 0.0]})).startswith("inspection.wind_m_s[0]: expected")


SHARED = "udpin://0.0.0.0:14550"


def test_a_site_without_a_depot_is_good() -> None:
    without = content()
    del without["depot"]
    assert check_site(without, "site.toml").depot is None


def test_one_port_on_two_other_machines_is_no_clash() -> None:
    hosts = [vehicle(number, connection=f"udpout://uav{number}:14550") for number in (1, 2)]
    assert len(check_site(content(*hosts), "site.toml").vehicle) == 2


def test_every_system_but_ours_can_be_a_vehicle() -> None:
    site = check_site(content(*(vehicle(number, connection=SHARED) for number in range(1, 255))), "site.toml")
    assert [one.sysid for one in site.vehicle] == list(range(1, 255))


def test_vehicles_may_share_a_connection() -> None:
    site = check_site(content(*(vehicle(number, connection=SHARED) for number in (1, 2))), "site.toml")
    assert site.vehicle[0].link == site.vehicle[1].link


def test_a_vehicle_may_have_several_links() -> None:
    several = ["serial:///dev/ttyUSB0:57600", "udpin://0.0.0.0:14550"]
    site = check_site(content(vehicle(1, connection=several), vehicle(2, connection=several)), "site.toml")
    assert [str(link) for link in site.vehicle[0].links] == several
    assert site.vehicle[1].links == site.vehicle[0].links
    assert str(site.vehicle[0].link) == several[0]


NAN, INF = float("nan"), float("inf")
UNKNOWN = "unknown key; expected one that docs/reference/site-file.md names"


@pytest.mark.parametrize(
    ("wrong", "expected"),
    [
        # vehicles
        (content(vehicle=[]), "vehicle: expected at least one [[vehicle]] table"),
        ({"network": {"file": "x"}}, "vehicle: expected at least one [[vehicle]] table"),
        (content(vehicle(1), vehicle(2, sysid=1)),
         "vehicle[1].sysid: expected a sysid of its own, got 1, which is also the sysid of vehicle 'uav1'"),
        (content(vehicle(1), vehicle(2, name="uav1")),
         "vehicle[1].name: expected a name of its own, got uav1, which is also the name of vehicle 'uav1'"),
        (content(vehicle(1), vehicle(2, connection="udpin://0.0.0.0:14551")),
         "vehicle[1].connection: expected a port of its own, or 'udpin://127.0.0.1:14551' as vehicle 'uav1' has it, "),
        (content(vehicle(1, connection="serial:///dev/ttyUSB0:57600"),
                 vehicle(2, connection="serial:///dev/ttyUSB0:115200")),
         "vehicle[1].connection: expected a port of its own, or 'serial:///dev/ttyUSB0:57600' as vehicle 'uav1' has "),
        (content(vehicle(1, connection=SHARED), vehicle(2, connection=SHARED, backend="mavsdk")),
         "vehicle[1].backend: expected 'native', as vehicle 'uav1' on the same connection has it, got 'mavsdk'"),
        (content(vehicle(sysid=0)), "vehicle[0].sysid: expected greater than or equal to 1, got 0"),
        (content(vehicle(sysid=255)), "vehicle[0].sysid: expected less than or equal to 254, got 255"),
        (content(vehicle(sysid=1.5)), "vehicle[0].sysid: expected "),
        (content(vehicle(name="")), "vehicle[0].name: "),
        (content(vehicle(name="a b")), "vehicle[0].name: "),
        (content(vehicle(name="../../etc")), "vehicle[0].name: "),
        (content(vehicle(autopilot="betaflight")),
         "vehicle[0].autopilot: expected 'ardupilot' or 'px4', got 'betaflight'"),
        (content(vehicle(backend="dronekit")), "vehicle[0].backend: expected 'native' or 'mavsdk', got 'dronekit'"),
        # budgets
        (content(vehicle(budget_pct=-5)), "vehicle[0].budget_pct: expected greater than or equal to 0, got -5"),
        (content(vehicle(budget_pct=120)), "vehicle[0].budget_pct: expected less than or equal to 100, got 120"),
        (content(vehicle(budget_pct=90, reserve_pct=15)),
         "vehicle[0].budget_pct: expected at most 85 with a reserve_pct of 15, got 90"),
        (content(vehicle(budget_pct=NAN)), "vehicle[0].budget_pct: "),
        (content(vehicle(reserve_pct=NAN)), "vehicle[0].reserve_pct: "),
        (content(vehicle(budget_pct="much")), "vehicle[0].budget_pct: expected a number"),
        # connections
        (content(vehicle(1, connection=[])), "vehicle[0].connection: expected 1 to 4, got 0"),
        (content(vehicle(1, connection=[f"udpin://0.0.0.0:{14550 + number}" for number in range(5)])),
         "vehicle[0].connection: expected 1 to 4, got 5"),
        (content(vehicle(1, connection=[SHARED, SHARED])),
         "vehicle[0].connection: expected each link over a port of its own, got udp port 14550 twice"),
        (content(vehicle(1, connection=["serial:///dev/ttyUSB0:57600", "serial:///dev/ttyUSB0:115200"])),
         "vehicle[0].connection: expected each link over a port of its own, got /dev/ttyUSB0 twice"),
        (content(vehicle(1, connection=[SHARED, "nonsense"])), "vehicle[0].connection: expected udpin://, "),
        (content(vehicle(1, connection=[SHARED, "udpin://0.0.0.0:14551"], backend="mavsdk")),
         "vehicle[0].connection: expected one with backend 'mavsdk', got a list"),
        (content(vehicle(1, connection=SHARED), vehicle(2, connection=["udpin://0.0.0.0:14551",
                                                                     "udpin://127.0.0.1:14550"])),
         "vehicle[1].connection: expected a port of its own, or 'udpin://0.0.0.0:14550' as vehicle 'uav1' has it, "),
        (content(vehicle(1, connection=7)), "vehicle[0].connection: expected a text or a list of texts, got 7"),
        *((content(vehicle(connection=text)),
           f"vehicle[0].connection: {EXPECTED}, got '{text}'")
          for text in ("", "14550", "udp://:14550", "udpin://", "udpin://127.0.0.1", "udpin://127.0.0.1:0",
                       "udpin://127.0.0.1:99999", "udpin://127.0.0.1:abc", "serial:/dev/ttyUSB0:57600",
                       "udpin://[::1:14550", "serial:///dev/ttyUSB0", "tcpout:///dev/ttyUSB0:57600")),
        (content(vehicle(connection="serial:///dev/ttyUSB0:12345")),
         "vehicle[0].connection: expected a baud rate of 9600, "),
        # depot
        (content(depot={"lat_deg": 115.6, "lon_deg": 49.6}),
         "depot.lat_deg: expected less than or equal to 89, got 115.6"),
        (content(depot={"lat_deg": 49.6, "lon_deg": 215.6}),
         "depot.lon_deg: expected less than or equal to 180, got 215.6"),
        (content(depot={"lat_deg": NAN, "lon_deg": 15.6}), "depot.lat_deg: "),
        (content(depot={"lat_deg": 49.6, "lon_deg": INF}), "depot.lon_deg: "),
        (content(depot={"lon_deg": 15.6}), "depot.lat_deg: expected this key, but it is missing"),
        (content(depot={"lat_deg": 49.6, "lon_deg": 15.6, "alt_m": 99999.0}), "depot.alt_m: "),
        # the rest
        (content(network={}), "network.file: expected this key, but it is missing"),
        (content(network={"file": "x", "radius_m": 0}), "network.radius_m: expected greater than 0, got 0"),
        (content(network={"file": 7}), "network.file: expected a text, got 7"),
        (content(inspection={"speed_m_s": 0}), "inspection.speed_m_s: expected greater than or equal to 0.01, got 0"),
        (content(inspection={"speed_m_s": NAN}), "inspection.speed_m_s: "),
        (content(inspection={"height_m": -15}), "inspection.height_m: expected greater than 0, got -15"),
        (content(inspection={"standoff_m": INF}), "inspection.standoff_m: "),
        (content(inspection={"hight_m": 15}), f"inspection.hight_m: {UNKNOWN}"),
        (content(pilot="me"), f"pilot: {UNKNOWN}"),
        (content(vehicle(wings=2)), f"vehicle[0].wings: {UNKNOWN}"),
        (content(energy={"drone": "paperplane"}), "energy.drone: expected one of "),
        (content(energy={"efficiency": 1.5}), "energy.efficiency: expected less than or equal to 1, got 1.5"),
        (content(flight={"speedup": 0}), "flight.speedup: expected greater than 0, got 0"),
        (content(flight={"solve_s": NAN}), "flight.solve_s: "),
        (content(flight={"fly_again": "perhaps"}), "flight.fly_again: expected 'ask', 'never' or 'auto'"),
        (content(faults={"link_timeout_s": -1}), "faults.link_timeout_s: expected greater than 0, got -1"),
        (content(vehicle="uav1"), "vehicle: expected "),
        (content(network="line.geojson"), "network: expected keys with values, got 'line.geojson'"),
    ],
)  # fmt: skip
def test_every_bad_value_is_named(wrong: Content, expected: str) -> None:
    assert reason(wrong).startswith(expected)


@pytest.mark.parametrize("table", ["depot", "inspection", "energy", "flight", "faults"])
def test_no_number_may_be_nan(table: str) -> None:
    """Whatever number a table has, NaN and infinity are none."""
    model: Any = Site.model_fields[table].annotation
    kinds = getattr(model, "__args__", (model,))
    fields = kinds[0].model_fields
    good = content().get(table, {})
    numbers = [key for key, field in fields.items() if "float" in str(field.annotation)]
    assert numbers
    for key in numbers:
        for value in (NAN, INF, -INF):
            assert reason(content(**{table: {**good, key: value}})).startswith(f"{table}.{key}: ")


def written(path: Path, text: str | bytes) -> Path:
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


FILES: list[tuple[str, Callable[[Path], Path], str]] = [
    ("missing", lambda folder: folder / "nowhere.toml", "no such file; expected a site file (TOML)"),
    ("a folder", lambda folder: folder, "cannot be read: Is a directory; expected a site file (TOML)"),
    ("not TOML", lambda folder: written(folder / "site.toml", "vehicle: uav1\n"), "not TOML: "),
    (
        "JSON",
        lambda folder: written(folder / "site.toml", '{"vehicle": []}'),
        "not TOML: Invalid statement (at line 1, column 1); expected a site file",
    ),
    (
        "not text",
        lambda folder: written(folder / "site.toml", b"\xff\xfe\x00"),
        "encoding: expected UTF-8 text, found other bytes at 0",
    ),
    ("empty", lambda folder: written(folder / "site.toml", ""), "vehicle: expected at least one [[vehicle]] table"),
    ("cut off", lambda folder: written(folder / "site.toml", '[network]\nfile = "li'), "not TOML: "),
]


@pytest.mark.parametrize(("make", "expected"), [row[1:] for row in FILES], ids=[row[0] for row in FILES])
def test_a_file_that_is_no_site(tmp_path: Path, make: Callable[[Path], Path], expected: str) -> None:
    path = make(tmp_path)
    with pytest.raises(SiteError) as raised:
        read_site(path)
    text = str(raised.value)
    assert text.startswith(f"{path}: {expected}")
    assert "\n" not in text


def test_a_site_is_read(tmp_path: Path) -> None:
    text = """
        [network]
        file = "line.geojson"
        [[vehicle]]
        name = "uav1"
        connection = "udpout://uav1.local:14550"
        sysid = 1
        autopilot = "px4"
    """
    assert read_site(written(tmp_path / "site.toml", text)).vehicle[0].autopilot == "px4"


def test_a_broker_and_its_defaults() -> None:
    table = check_site(content(mqtt={}), "site.toml").mqtt
    assert table is not None
    assert (table.host, table.port, table.prefix, table.telemetry_rate_hz) == ("127.0.0.1", None, "faultline", 1.0)
    assert check_site(content(), "site.toml").mqtt is None


@pytest.mark.parametrize(
    ("host", "is_here"),
    [
        ("localhost", True),
        ("127.0.0.1", True),
        ("::1", True),
        ("broker", False),
        ("10.0.0.7", False),
        ("fe80::1", False),
    ],
)
def test_whether_the_broker_is_on_this_computer(host: str, is_here: bool) -> None:
    table = check_site(content(mqtt={"host": host}), "site.toml").mqtt
    assert table is not None
    assert table.is_here is is_here


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ({"host": "a b"}, "mqtt.host"),
        ({"host": "x" * 64 + ".example"}, "mqtt.host"),
        ({"port": 0}, "mqtt.port"),
        ({"prefix": "a/#"}, "mqtt.prefix"),
        ({"prefix": "/a"}, "mqtt.prefix"),
        ({"telemetry_rate_hz": 0}, "mqtt.telemetry_rate_hz"),
        ({"password": "secret"}, "mqtt.password: unknown key"),
        ({"password_env": "P"}, "mqtt.password_env: expected a username_env"),
        ({"ca_file": "ca.pem"}, "mqtt.ca_file: expected none without tls"),
        ({"cert_file": "client.pem"}, "mqtt.cert_file: expected none without tls"),
        ({"tls": True, "key_file": "client.key"}, "mqtt.key_file: expected a cert_file"),
        ({"tls": True, "key_password_env": "P"}, "mqtt.key_password_env: expected a cert_file"),
        ({"protocol": "4"}, "mqtt.protocol"),
        ({"protocol": 5}, "mqtt.protocol"),
        ({"websocket_path": "mqtt"}, "mqtt.websocket_path"),
        ({"websocket_path": "/a b"}, "mqtt.websocket_path"),
        ({"clear_retained": "perhaps"}, "mqtt.clear_retained"),
        ({"token_env": "not a name"}, "mqtt.token_env"),
    ],
)
def test_a_broker_that_cannot_be(table: Content, key: str) -> None:
    assert reason(content(mqtt=table)).startswith(key)


def test_secrets_come_from_the_environment() -> None:
    assert read_secret(None, "mqtt.password_env", "site.toml", {}) is None
    assert read_secret("P", "mqtt.password_env", "site.toml", {"P": "x"}) == "x"
    for environment in ({}, {"P": ""}):
        with pytest.raises(
            SiteError, match=r"^site.toml: mqtt.password_env: expected a value in .* P, which is not set$"
        ):
            read_secret("P", "mqtt.password_env", "site.toml", environment)


def test_radios_are_named_by_the_sender_of_their_reports() -> None:
    assert check_site(content(), "site.toml").link.senders is None
    named = content(link={"radios": [{"system": 51, "component": 68}]})
    assert check_site(named, "site.toml").link.senders == frozenset({(51, 68)})
    assert check_site(content(link={"radios": []}), "site.toml").link.senders == frozenset()


@pytest.mark.parametrize(
    ("radios", "why"),
    [
        ([{"system": 51}], "link.radios[0].component: expected this key, but it is missing"),
        ([{"system": 0, "component": 68}], "link.radios[0].system: expected greater than or equal to 1, got 0"),
        ([{"system": 51, "component": 68, "baud": 1}], "link.radios[0].baud: unknown key"),
        ([{"system": 51, "component": 68}] * 2, "link.radios[1]: expected each radio once, got system 51 component 68"),
        ([{"system": 1, "component": 1}], "link.radios[0]: expected a radio, got system 1 component 1, the autopilot"),
    ],
)
def test_a_radio_that_cannot_be(radios: list[dict[str, int]], why: str) -> None:
    said = reason(content(vehicle(1), link={"radios": radios}))
    assert said.startswith(why)
    assert "\n" not in said


@pytest.mark.parametrize(
    ("ours", "why"),
    [
        (0, "link.station_sysid: expected greater than or equal to 1, got 0"),
        (256, "link.station_sysid: expected less than or equal to 255, got 256"),
        (2, "link.station_sysid: expected a number that no vehicle has, got 2, the sysid of vehicle 'uav2'"),
    ],
)
def test_our_station_number_must_be_unique(ours: int, why: str) -> None:
    two = (vehicle(1), vehicle(2, connection="udpin://127.0.0.1:14552"))
    assert reason(content(*two, link={"station_sysid": ours})) == why
    assert check_site(content(*two), "site.toml").link.station == (255, 190)
    assert check_site(content(*two, link={"station_sysid": 254}), "site.toml").link.station == (254, 190)


@pytest.mark.parametrize(
    ("forward", "why"),
    [
        ({"to": ["udpout:127.0.0.1"]}, "forward.to[0]: expected udpin://, udpout://, tcpin:// or tcpout://HOST:PORT"),
        ({"to": ["tcpin://0.0.0.0:0"]}, "forward.to[0]: expected udpin://, udpout://, tcpin:// or tcpout://HOST:PORT"),
        (
            {"to": ["tcpin://0.0.0.0:5760", "tcpin://127.0.0.1:5760"]},
            "forward.to[1]: expected a port of its own, got 'tcpin://127.0.0.1:5760' again",
        ),
        (
            {"to": ["udpout://127.0.0.1:14551"]},
            "forward.to[0]: expected a port of its own, got 'udpout://127.0.0.1:14551', that of vehicle 'uav1'",
        ),
        ({"allow_orders": True}, "forward.to: expected at least one connection with allow_orders, got none"),
        ({"to": [], "bytes_s": -1}, "forward.bytes_s: expected greater than or equal to 0, got -1"),
        ({"port": 5760}, "forward.port: unknown key"),
    ],
)
def test_a_port_for_other_stations_that_cannot_be(forward: dict[str, object], why: str) -> None:
    said = reason(content(vehicle(1), forward=forward))
    assert said.startswith(why)
    assert "\n" not in said


def test_other_stations_get_nothing_unless_the_site_says_so() -> None:
    assert check_site(content(), "site.toml").forward.ports == ()
    site = check_site(content(forward={"to": ["tcpin://127.0.0.1:5760"]}), "site.toml")
    assert [str(port) for port in site.forward.ports] == ["tcpin://127.0.0.1:5760"]
    assert site.forward.allow_orders is False


def test_frames_are_forwarded_of_what_has_frames_alone() -> None:
    said = reason(content(vehicle(1, backend="mavsdk"), forward={"to": ["tcpin://127.0.0.1:5760"]}))
    assert said == "vehicle[0].backend: expected 'native' with [forward], got 'mavsdk', which has no frames"


def test_a_key_comes_from_a_file_or_from_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    digits = "0f" * 32
    (tmp_path / "key").write_text(f"{digits}\n")
    from_file = check_site(content(signing={"key_file": "key"}), "site.toml")
    assert read_signing_key(from_file, tmp_path) == bytes.fromhex(digits)
    from_environment = check_site(content(signing={"key_env": "LINE_KEY"}), "site.toml")
    monkeypatch.setenv("LINE_KEY", "a passphrase")
    assert read_signing_key(from_environment, tmp_path) == hashlib.sha256(b"a passphrase").digest()
    assert read_signing_key(check_site(content(), "site.toml"), tmp_path) is None
    monkeypatch.delenv("LINE_KEY")
    with pytest.raises(SiteError, match=r"signing\.key_env: expected a value in the environment variable LINE_KEY"):
        read_signing_key(from_environment, tmp_path)
    (tmp_path / "key").write_text(" \n")
    with pytest.raises(SiteError, match="expected 64 hexadecimal digits or a passphrase"):
        read_signing_key(from_file, tmp_path)
    (tmp_path / "key").unlink()
    with pytest.raises(SiteError, match=r"signing\.key_file: .*key: cannot be read"):
        read_signing_key(from_file, tmp_path)


def test_what_cannot_be_signed_is_refused() -> None:
    assert reason(content(signing={})) == "signing.key_file: expected either key_file or key_env"
    mixed = content(vehicle(1), vehicle(2, backend="mavsdk"), signing={"key_env": "LINE_KEY"})
    assert reason(mixed).startswith("vehicle[1].backend: expected 'native' with [signing]")
