"""What the tests of a module share: a browser, and a server of the plan page."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser

from tests.e2e.browser import running
from tests.executor.plan_page.opened import Opened, make_demo_site, opened


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def chromium() -> AsyncIterator[Browser]:
    """The browser that pages are opened in."""
    async with running() as browser:
        yield browser


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Opened]:
    """A server with its processes, which a test has open a site of its own."""
    with opened(tmp_path_factory.mktemp("sites"), None) as server:
        yield server


@pytest.fixture
def site(shared: Opened, tmp_path: Path) -> Path:
    """A site over a part of the network that comes with faultline, which the shared server may open."""
    folder = shared.root / tmp_path.name
    folder.mkdir()
    return make_demo_site(folder)
