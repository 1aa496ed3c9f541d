"""The command that estimates the chance of finishing: the same answer from everywhere, and what it says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from executor.analysis.pictures import draw_risk_figure
from executor.cli.main import main
from executor.site.campaigns import SWEEP, open_campaign_runner, sweep_mtbf
from missions import write_plan
from planner import RiskCampaign, estimate_risks, simulate_chunk, split_flights
from tests.executor.flights import first_campaign, first_plan_file
from tests.ports import free_port

PARTS = split_flights(300, 1, per_chunk=100)


@pytest.fixture(scope="module")
def content() -> RiskCampaign:
    return first_campaign()


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    path = tmp_path / "plan.json"
    write_plan(path, first_plan_file())
    return path


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    said = capsys.readouterr()
    assert isinstance(ended.value.code, int)
    return ended.value.code, said.out, said.err


def ignored(done: int, total: int) -> None:
    """Take the progress."""


def test_a_cluster_that_is_away_is_one_line(plan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    address = f"tcp://127.0.0.1:{free_port()}"
    code, out, err = run(capsys, "risk", plan, "--mtbf", 10, "--dask", address)
    assert (code, out) == (2, "")
    assert err == f"faultline: --dask: no scheduler at {address}; expected one such as tcp://10.0.0.1:8786\n"


def test_json_has_the_chances_and_their_intervals(plan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ("risk", plan, "--mtbf", 0.1, "--samples", 2000, "--jobs", 1, "--max-losses", 3, "--json")
    code, out, err = run(capsys, *arguments)
    assert (code, err) == (0, "")
    document: dict[str, Any] = json.loads(out)
    assert (document["mtbf_h"], document["flights"], document["seed"]) == (0.1, 2000, 1)
    finishing = document["finishing"]
    assert [row["losses_replanned"] for row in finishing] == [0, 1, 2, 3]
    assert all(row["low_95"] < row["probability"] < row["high_95"] for row in finishing)
    left_m = [row["expected_uninspected_m"] for row in finishing]
    assert left_m == sorted(left_m, reverse=True)
    assert sum(document["flights_with_losses"].values()) == pytest.approx(1.0)
    assert set(document["failures"]["share_by_vehicle"]) == {"uav1", "uav2", "uav3"}
    assert document["failures"]["most"]["vehicle"] in {"uav1", "uav2", "uav3"}
    assert run(capsys, *arguments) == (code, out, err)


def test_in_words(plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(
        capsys, "risk", plan, "--mtbf", 0.1, "--samples", 500, "--jobs", 1, "--picture", tmp_path / "risk.png"
    )
    assert code == 0
    first, *rows, losses, blame, most = out.splitlines()
    assert first == "everything inspected, 500 flights, one failure in 0.1 flight hours:"
    assert [row.split("  ")[1] for row in rows] == [
        "as planned, without a re-plan", "re-planned after one loss", "re-planned after up to 2 losses",
    ]  # fmt: skip
    assert losses.startswith("losses: ")
    assert blame.startswith("losses without a re-plan: uav1 ")
    assert most.startswith("most of them: uav")
    assert (tmp_path / "risk.png").read_bytes().startswith(b"\x89PNG")
    code, out, _ = run(capsys, "risk", plan, "--mtbf", 1e9, "--samples", 500, "--jobs", 1)
    assert out.splitlines()[-1] == "every flight finished"


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [(("--mtbf", "0"), "--mtbf"), ((), "--mtbf"), (("--mtbf", "1", "--max-losses", "0"), "--max-losses")],
)
def test_bad_figures_are_one_line(
    plan: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], reason: str
) -> None:
    code, out, err = run(capsys, "risk", plan, *arguments)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert reason in err


def test_a_sweep_has_a_curve_for_each_number_of_replans(content: RiskCampaign) -> None:
    campaign, parts = sweep_mtbf(content, 1, flights=50)
    with open_campaign_runner(jobs=1, dask=None) as fly:
        swept, given = (
            estimate_risks(campaign, fly(simulate_chunk, campaign, parts, ignored)),
            estimate_risks(content, fly(simulate_chunk, content, PARTS, ignored))[0],
        )
    assert [risk.mtbf_h for risk in swept] == [0.1 * factor for factor in SWEEP]
    (axes,) = draw_risk_figure(swept, given).axes
    curves = [line for line in axes.lines if np.size(line.get_xdata()) == len(SWEEP)]
    assert [np.asarray(curve.get_ydata()).tolist() for curve in curves] == [
        [100 * risk.finished[replans].estimate for risk in swept] for replans in range(3)
    ]
    words = " ".join(text.get_text() for text in axes.texts)
    assert f"{100 * given.finished[1].estimate:.2f} % at 0.1 h" in words
