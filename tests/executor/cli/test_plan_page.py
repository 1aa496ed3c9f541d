from __future__ import annotations

from pathlib import Path

import pytest

from executor.cli.main import main
from tests.executor.plan_page.opened import make_demo_site, opened


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["gone.toml"], "gone.toml: no such file; expected a site, a network or a plan"),
        (["plan.json"], "plan.json: expected its site file next to it, found 0; open that one instead"),
        (["line.kml"], "line.kml: "),
        (["--host", "0.0.0.0"], "--token-env: expected the name of an environment variable with a token"),  # noqa: S104
        (["--host", "here"], "--host: expected an address such as 127.0.0.1 or 0.0.0.0, got 'here'"),
        (["--token-env", "NO_TOKEN"], "web.token_env: expected a token of 16 or more letters, digits or hyphens"),
        (["bad.toml"], "bad.toml: encoding: expected UTF-8 text"),
    ],
)
def test_what_cannot_be_opened_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: list[str], line: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("NO_TOKEN", raising=False)
    Path("plan.json").write_text('{"format": "faultline-plan/2"}')
    Path("line.kml").write_text("<html>")
    if "bad.toml" in words:
        Path("bad.toml").write_bytes(b"\xff")
    with pytest.raises(SystemExit) as ended:
        main(["open", "--no-browser", *words])
    said = capsys.readouterr().err
    assert ended.value.code == 2
    assert said.startswith("faultline: ")
    assert line in said
    assert said.count("\n") == 1
    assert not Path("site.toml").exists()


def test_a_site_that_is_open_already_is_not_opened_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with opened(tmp_path, make_demo_site(tmp_path)), pytest.raises(SystemExit) as ended:
        main(["open", "--no-browser"])
    assert ended.value.code == 2
    assert "site.toml: is open in another plan page" in capsys.readouterr().err
