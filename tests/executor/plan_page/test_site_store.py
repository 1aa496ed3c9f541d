from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from executor.errors import LogError, SiteError
from executor.plan_page.site_document import Edit
from executor.plan_page.site_store import BY_OTHERS, SiteStore

FIRST = '# ours\n[network]\nfile = "default" # of the house\n'


class Killed(BaseException):
    """The process ends here."""


@pytest.fixture
def site(tmp_path: Path) -> Path:
    path = tmp_path / "site.toml"
    path.write_text(FIRST)
    return path


def height(value: float) -> list[Edit]:
    return [Edit("set", ("inspection", "height_m"), value)]


def said(path: Path) -> str:
    return path.read_text()


def test_every_change_is_on_disk_at_once_and_undone_after_a_restart(site: Path) -> None:
    with SiteStore(site) as store:
        store.edit("height", height(20))
        assert said(site) == FIRST + "\n[inspection]\nheight_m = 20\n"
        store.edit("height again", height(25))
        store.undo()
        assert "height_m = 20" in said(site)
    with SiteStore(site) as store:
        assert (store.history.undo_label, store.history.redo_label) == ("height", "height again")
        store.redo()
        assert "height_m = 25" in said(site)
        store.undo()
        store.undo()
        store.undo()
    assert said(site) == FIRST


def test_what_an_editor_writes_is_read_and_can_be_undone(site: Path) -> None:
    with SiteStore(site) as store:
        store.edit("height", height(20))
        site.write_text("# theirs\n")
        assert store.look()
        assert not store.look()
        assert (store.history.text, store.history.undo_label) == ("# theirs\n", BY_OTHERS)
        store.undo()
        assert "height_m = 20" in said(site)
    site.write_text("# while nobody looked\n")
    with SiteStore(site) as store:
        assert store.history.text == "# while nobody looked\n"
        store.undo()
        assert "height_m = 20" in said(site)


def test_what_an_editor_writes_before_a_save_is_not_overwritten(site: Path) -> None:
    with SiteStore(site) as store:
        site.write_text("# theirs\n")
        store.edit("height", height(20))
        assert said(site) == "# theirs\n"
        store.undo()
        assert said(site) == FIRST + "\n[inspection]\nheight_m = 20\n"


def test_what_is_no_text_is_left_alone_and_reported(site: Path) -> None:
    with SiteStore(site) as store:
        site.write_bytes(b"\xff\xfe")
        store.edit("height", height(20))
        assert site.read_bytes() == b"\xff\xfe"
        assert "expected UTF-8 text" in (store.save_error or "")
        assert not store.saved
        site.write_text(FIRST)
        store.look()
        assert (store.saved, store.save_error) == (True, None)
    assert "height_m = 20" in said(site)


def test_one_page_holds_a_site(site: Path) -> None:
    with SiteStore(site), pytest.raises(LogError, match="is open in another plan page"), SiteStore(site):
        pass
    with SiteStore(site):
        pass


def test_a_site_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(SiteError, match="no such file"), SiteStore(tmp_path / "site.toml"):
        pass


def test_a_full_disk_is_reported_and_nothing_is_lost(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with SiteStore(site) as store:
        with monkeypatch.context() as patch:
            patch.setattr(os, "fsync", _raise_full)
            store.edit("height", height(20))
            store.edit("height", height(25))
            assert not store.saved
            assert "No space left on device; the change is kept in memory" in (store.save_error or "")
            assert said(site) == FIRST
        store.look()
        assert (store.saved, store.save_error) == (True, None)
    with SiteStore(site) as store:
        assert "height_m = 25" in store.history.text
        store.undo()
        assert "height_m = 20" in said(site)


def _raise_full(_: int) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_folder_that_cannot_be_written_to_is_reported(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "mkdir", lambda *_, **__: _raise_full(0))
    with SiteStore(site) as store:
        assert "No space left" in (store.save_error or "")
        store.edit("height", height(20))
        assert "height_m = 20" in store.history.text


@pytest.mark.parametrize("ends_at", range(12))
def test_a_server_that_is_killed_in_the_middle_of_a_save_loses_no_change_that_it_has_promised(
    site: Path, monkeypatch: pytest.MonkeyPatch, ends_at: int
) -> None:
    promised = 0
    with monkeypatch.context() as patch:
        count = 0

        def counted(does: Callable[..., Any]) -> Callable[..., Any]:
            def work(*words: Any, **named: Any) -> Any:
                nonlocal count
                count += 1
                if count > ends_at:
                    raise Killed
                return does(*words, **named)

            return work

        patch.setattr(os, "fsync", counted(os.fsync))
        patch.setattr(Path, "replace", counted(Path.replace))
        store = SiteStore(site)
        try:
            store.__enter__()
            for number in (1, 2, 3):
                store.edit(f"height {number}", height(number))
                promised = number
        except Killed:
            pass
        store._stack.close()
    written = said(site)
    with SiteStore(site) as again:
        last = again.history.steps[-1].label if again.history.steps else "height 0"
        assert int(last.removeprefix("height ")) >= promised, written
        assert said(site) == again.history.text
        while again.history.undo_label:
            again.undo()
        assert said(site) == FIRST
