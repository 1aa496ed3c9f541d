"""Files of every format with bytes changed, cut and doubled: what is wrong with one is a line, never a traceback."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from missions import NetworkError, import_network
from tests.missions.readers import same
from tests.missions.readers.test_formats import FILES

COPIES = 40


def damaged(content: bytes, chance: random.Random) -> bytes:
    """Return a content as a bad disk, a broken transfer or a careless editor leaves it."""
    at, length = chance.randrange(len(content)), chance.choice((1, 4, 16, 400))
    match chance.randrange(4):
        case 0:
            return content[:at]
        case 1:
            return content[:at] + chance.randbytes(length) + content[at + length :]
        case 2:
            return content[:at] + content[at + length :]
        case _:
            return content[:at] + content[max(0, at - length) : at] * 2 + content[at:]


@pytest.mark.parametrize("name", [*FILES, "GPX"])
def test_a_damaged_file_is_read_or_refused_in_a_line(name: str, tmp_path: Path) -> None:
    write, wanted = FILES.get(name, (same.gpx, FILES["KMZ"][1]))
    path = write(tmp_path)
    content, chance = path.read_bytes(), random.Random(name)
    reasons = []
    for _ in range(COPIES):
        path.write_bytes(damaged(content, chance))
        try:
            import_network(path, wanted, anywhere=True)
        except NetworkError as error:
            reasons.append(str(error))
    assert reasons
    assert [reason for reason in reasons if not reason.startswith(f"{path}: ") or "\n" in reason] == []
