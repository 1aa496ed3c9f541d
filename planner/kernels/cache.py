"""Where compiled kernels are kept between processes.

numba notices a change in the file of a kernel, not in the files of the kernels that it calls (numba #1833), and by
default writes beside the sources, which may be read-only. So the kernels are cached in a directory of the user's,
one for each state of all their sources and each numba.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import sys
import tempfile
from pathlib import Path

import numba


def use_cache() -> None:
    """Have numba keep the kernels that are declared from now on in ``make_cache_directory``."""
    numba.config.CACHE_DIR = str(make_cache_directory(numba.__version__))  # type: ignore[attr-defined] # set at run time


def compute_sources_digest(version: str) -> str:
    """Return a short digest of the kernels' sources and numba's ``version``."""
    digest = hashlib.sha256(version.encode())
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def make_cache_directory(version: str) -> Path:
    """Return a directory for compiled kernels, made and writable.

    It lies in NUMBA_CACHE_DIR if that is set, else in the user's cache directory. Where neither can be written it is
    a private one that goes when the process ends: a predictable name in a shared directory would let others plant
    code.
    """
    chosen = _find_user_cache() / f"kernels-{compute_sources_digest(version)}"
    try:
        chosen.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.TemporaryFile(dir=chosen):
            return chosen
    except OSError:
        private = Path(tempfile.mkdtemp(prefix="faultline-kernels-"))
        atexit.register(shutil.rmtree, private, ignore_errors=True)
        return private


def _find_user_cache() -> Path:
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        return Path(given)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "faultline"
