"""Real MQTT brokers: mosquitto where it is installed, and amqtt, which pip brings; each in a process of its own."""

from __future__ import annotations

import asyncio
import json
import shutil
import signal
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path

from tests.patience import PATIENCE_S
from tests.ports import free_port
from tests.programs import find_program

USER, PASSWORD = "crew", "p4ss word"
MOSQUITTO = find_program("mosquitto")
KIND = "amqtt" if MOSQUITTO is None else "mosquitto"
"""The one that is quicker to start."""


@dataclass(frozen=True, slots=True)
class Secured:
    """Certificates for TLS on this computer."""

    authority: Path
    certificate: Path
    key: Path
    client: Path
    """Certificate and key of a client."""


class RealBroker:
    """A broker on a port of its own, which can be stopped, started again and suspended."""

    def __init__(self, kind: str, folder: Path, *, secured: Secured | None = None, **asked: bool) -> None:
        self.port = free_port()
        self._kind = kind
        folder.mkdir(exist_ok=True)
        if kind == "mosquitto":
            self._file = _mosquitto_file(folder, self.port, secured, **asked)
        else:
            self._file = _amqtt_file(folder, self.port, secured, **asked)
        self._process: asyncio.subprocess.Process | None = None
        self._reading: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Return when clients are answered."""
        if self._kind == "mosquitto":
            assert MOSQUITTO is not None
            command = [MOSQUITTO, "-c", str(self._file)]
        else:
            command = [sys.executable, "-W", "ignore", "-m", "amqtt.scripts.broker_script", "-c", str(self._file)]
        pipe = asyncio.subprocess.PIPE
        self._process = await asyncio.create_subprocess_exec(*command, stderr=pipe, stdout=asyncio.subprocess.DEVNULL)
        assert self._process.stderr is not None
        stream, seen = self._process.stderr, b""
        async with asyncio.timeout(PATIENCE_S):
            while b" running" not in seen and b"Listener 'default' bind to" not in seen:
                line = await stream.readline()
                assert line, f"the broker ended: {seen.decode()}"
                seen += line

        async def rest() -> None:
            while await stream.readline():
                pass

        self._reading = asyncio.create_task(rest())

    def suspend(self) -> None:
        """Let it do nothing: the kernel still accepts connections for it."""
        self._signal(signal.SIGSTOP)

    def go_on(self) -> None:
        self._signal(signal.SIGCONT)

    async def stop(self) -> None:
        """End it at once; it forgets everything."""
        if self._process is None:
            return
        if self._process.returncode is None:
            self._signal(signal.SIGKILL)
        await self._process.wait()
        if self._reading is not None:
            await self._reading
        self._process = None

    def _signal(self, number: signal.Signals) -> None:
        assert self._process is not None
        self._process.send_signal(number)


@asynccontextmanager
async def running(
    kind: str, folder: Path, *, secured: Secured | None = None, **asked: bool
) -> AsyncIterator[RealBroker]:
    """A broker that ends with the block.

    With `password` it wants one, with `clients` certificates of who connects, with `websocket` it is reached over one;
    the last two mosquitto only.
    """
    broker = RealBroker(kind, folder, secured=secured, **asked)
    try:
        await broker.start()
        yield broker
    finally:
        await broker.stop()


@asynccontextmanager
async def slowed(port: int, bytes_per_s: float) -> AsyncIterator[int]:
    """A relay before a broker that lets so much through from who connects to it."""
    closing = set[asyncio.Task[None]]()

    async def pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, s_per_byte: float) -> None:
        try:
            with suppress(OSError):
                while data := await reader.read(512):
                    writer.write(data)
                    await writer.drain()
                    await asyncio.sleep(s_per_byte * len(data))
        finally:
            writer.close()
            with suppress(OSError):
                await writer.wait_closed()

    async def connected(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            there_reader, there_writer = await asyncio.open_connection("127.0.0.1", port)
        except OSError:
            writer.close()
            return
        for work in (pass_on(reader, there_writer, 1.0 / bytes_per_s), pass_on(there_reader, writer, 0.0)):
            closing.add(asyncio.create_task(work))

    server = await asyncio.start_server(connected, "127.0.0.1", 0, limit=1024)
    try:
        yield int(server.sockets[0].getsockname()[1])
    finally:
        server.close()
        for task in closing:
            task.cancel()
        await asyncio.gather(*closing, return_exceptions=True)


def _mosquitto_file(
    folder: Path, port: int, secured: Secured | None, *, password: bool = False, clients: bool = False,
    websocket: bool = False,
) -> Path:  # fmt: skip
    lines = ["persistence false", "log_dest stderr", "user root"]
    if websocket:
        # Without another listener 2.0 ends; an address is not known as one.
        lines += [f"listener {free_port()} 127.0.0.1", f"listener {port}", "socket_domain ipv4", "protocol websockets"]
    else:
        lines.append(f"listener {port} 127.0.0.1")
    lines.append(f"allow_anonymous {'false' if password else 'true'}")
    if password:
        known = folder / "passwords"
        program = shutil.which("mosquitto_passwd")
        assert program is not None
        subprocess.run([program, "-b", "-c", str(known), USER, PASSWORD], check=True, timeout=PATIENCE_S)
        lines.append(f"password_file {known}")
    if secured is not None:
        lines += [f"certfile {secured.certificate}", f"keyfile {secured.key}"]
        if clients:
            lines += [f"cafile {secured.authority}", "require_certificate true"]
    path = folder / "mosquitto.conf"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _amqtt_file(folder: Path, port: int, secured: Secured | None, *, password: bool = False) -> Path:
    from pwdlib.hashers.argon2 import Argon2Hasher

    listener: dict[str, object] = {"type": "tcp", "bind": f"127.0.0.1:{port}"}
    if secured is not None:
        listener |= {"ssl": True, "certfile": str(secured.certificate), "keyfile": str(secured.key)}
    plugins: dict[str, object] = {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}}
    if password:
        known = folder / "passwords"
        known.write_text(f"{USER}:{Argon2Hasher().hash(PASSWORD)}\n", encoding="utf-8")
        plugins = {"amqtt.plugins.authentication.FileAuthPlugin": {"password_file": str(known)}}
    path = folder / "amqtt.yaml"
    path.write_text(json.dumps({"listeners": {"default": listener}, "plugins": plugins}), encoding="utf-8")
    return path


def secured_in(folder: Path) -> Secured:
    """Make an authority, a certificate of it for 127.0.0.1, and one for a client."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    def named(text: str) -> x509.Name:
        return x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, text)])

    now, keys = datetime.now(UTC), [ec.generate_private_key(ec.SECP256R1()) for _ in range(3)]
    span = (now - timedelta(hours=1), now + timedelta(hours=1))
    authority, broker, client = (named(f"a test's {one}") for one in ("authority", "broker", "client"))
    certificates = []
    for subject, key, is_authority in ((authority, keys[0], True), (broker, keys[1], False), (client, keys[2], False)):
        building = (
            x509.CertificateBuilder(authority, subject, key.public_key(), x509.random_serial_number(), *span)
            .add_extension(x509.BasicConstraints(ca=is_authority, path_length=None), critical=True)
            .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ip_address("127.0.0.1"))]), critical=False)
        )
        certificates.append(building.sign(keys[0], hashes.SHA256()))
    made = Secured(folder / "authority.pem", folder / "broker.pem", folder / "broker.key", folder / "client.pem")
    pem = serialization.Encoding.PEM
    made.authority.write_bytes(certificates[0].public_bytes(pem))
    made.certificate.write_bytes(certificates[1].public_bytes(pem))
    plain = (serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    made.key.write_bytes(keys[1].private_bytes(pem, *plain))
    made.client.write_bytes(certificates[2].public_bytes(pem) + keys[2].private_bytes(pem, *plain))
    return made
