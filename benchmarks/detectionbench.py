"""Implementation of `faultline bench detection`: modelled flights, recorded ones with truths, logs of real aircraft."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from benchmarks.detection import campaign, detection_summary
from benchmarks.detectionpage import (
    detection_document,
    judge_recorded_flights,
    logs_directory,
    markdown,
    print_recorded,
    print_summary,
)
from benchmarks.progress import ShownProgress
from benchmarks.reallogs import judge_logs, logs_under
from benchmarks.reallogspage import print_real, real_document, real_markdown
from benchmarks.store import Json, keep_result


def make_detection(modelled: tuple[int, int] | None, seed: int, jobs: int, logs: Path | None, out: Path | None) -> Json:
    """Compute the figures and, with an output folder, write the pages.

    Args:
        modelled: numbers of healthy flights, and of each fault; None for recorded flights only.
        seed: of the modelled flights.
        jobs: processes.
        logs: folder of recorded flights; by default ../shared/logs.
        out: folder for the pages.

    Raises:
        BenchError: the folder of logs does not exist, or `out` cannot be written.
        LogError: a file of truths cannot be used.
    """
    folder = logs_directory(logs)
    content: Json = {"recorded": [], "real": None}
    rows = [] if folder is None else judge_recorded_flights(folder)
    if modelled is not None:
        healthy, faulty = modelled
        with ShownProgress() as shown:
            pairs = campaign(healthy, faulty, seed, jobs, partial(shown.show_stage, "flights"))
        figures = {
            "watchpoints": detection_summary([pair.watchpoints for pair in pairs]),
            "few_lines": detection_summary([pair.few_lines for pair in pairs]),
        }
        content |= detection_document(healthy, faulty, seed, figures, rows)
        if out is not None:
            keep_result("detection", content, markdown(content), out)
    content["recorded"] = rows
    if folder is not None and logs_under(folder):
        with ShownProgress() as shown:
            content["real"] = real_document(folder, judge_logs(folder, jobs, partial(shown.show_stage, "logs")))
        if out is not None:
            keep_result("real-logs", content["real"], real_markdown(content["real"]), out)
    content["skipped"] = "" if folder is not None else "no recorded flights: ../shared/logs is not there"
    return content


def print_detection(content: Json) -> None:
    """Print the figures."""
    for name in ("watchpoints", "few_lines"):
        if name in content:
            print_summary(name.replace("_", " "), content[name])
    print_recorded(content)
    if content["real"] is not None:
        print_real(content["real"])
    if content["skipped"]:
        print(content["skipped"])
