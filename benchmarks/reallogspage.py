"""The page of `faultline bench detection --logs`: logs of real aircraft, checked against their own statements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.detectionpage import FEW_LINES, NAMES
from benchmarks.machine import machine, machine_line
from benchmarks.markdown import MISSING, figure, markdown_page, markdown_table
from benchmarks.reallogs import real_summary
from benchmarks.store import Json

INTRODUCTION = (
    "`faultline bench detection --logs FOLDER`: {logs} logs of real aircraft, not flown as tests, of which {followed} "
    "are followed and {flown} hold a flight: {hours:.2f} flight hours of {aircraft} aircraft. Every declaration is "
    "compared with the log's own statements, read by pymavlink and pyulog without any of the code that is judged: the "
    "source of a mode order (COMMAND_ACK, SET_MODE, MODE.Rsn, the mode switch's channel), texts and records of "
    "failsafes and crashes (STATUSTEXT, MSG, ERR), HEARTBEAT.system_status, arming, heights, attitude, gaps in the "
    "vehicle's own frames, and the behaviour of the pack, by cell, until the end of the flight. A declaration that a "
    "line of the log contradicts is refuted, a false alarm; one that the log neither confirms nor contradicts is "
    "undecided, and counted separately. Intervals are 95 %, by bootstrap over aircraft, because errors in flights of "
    "one aircraft are correlated; where nothing is refuted they are Poisson intervals, as for independent flights."
)
STATED = (
    "Every crash, battery failsafe and link gap that a log states for an armed vehicle. In time means declared with "
    "its kind, at most 2 s after the text (for a gap in which others were received: after the time-out of 4.5 s); late "
    "means within a minute."
)


def real_document(folder: Path, rows: Sequence[Json]) -> Json:
    """Return the content of real-logs.json."""
    return {"machine": machine(), "folder": folder.name, **real_summary(rows), "rows": list(rows)}


def real_markdown(content: Mapping[str, Any]) -> str:
    """Return the page."""
    ours = content["watchpoints"]
    return markdown_page(
        "Detection on logs of real aircraft",
        machine_line(content["machine"]),
        INTRODUCTION.format(hours=content["flight_hours"], **{
            name: content[name] for name in ("logs", "followed", "flown", "aircraft")
        }),
        markdown_table(("", *NAMES.values()), _head(content)),
        f"The detector of a few lines is {FEW_LINES}; it reports each kind once in a log.",
        "## By kind",
        markdown_table(
            ("", "declared", "confirmed", "refuted", "undecided", "refuted in 50 flight hours (95 %)"),
            [
                (name, row["declared"], row["confirmed"], row["refuted"], row["undecided"], _rate(row))
                for name, row in ours["kinds"].items()
            ],
        ),
        "## What the logs state",
        STATED,
        _render_statements(content),
        "## Refuted",
        _verdicts(content["rows"], "refuted") or "Nothing.",
        "## Undecided",
        _verdicts(content["rows"], "undecided") or "Nothing.",
        "## Missed or late",
        _render_missed(content["rows"]) or "Nothing.",
        "## Not followed",
        _render_not_followed(content),
    )  # fmt: skip


def _rate(row: Mapping[str, Any]) -> str:
    if row["refuted_per_50_h"] is None:
        return MISSING
    low, high = row["refuted_per_50_h_95"]
    return f"{row['refuted_per_50_h']:.1f} ({low:.1f} to {high:.1f})"


def _head(content: Mapping[str, Any]) -> list[tuple[object, ...]]:
    those = [content[name] for name in NAMES]
    return [
        *((name, *(one[name] for one in those)) for name in ("declared", "confirmed", "refuted", "undecided")),
        ("refuted in 50 flight hours (95 %)", *(_rate(one) for one in those)),
        *(
            (f"{what} stated, declared in time", *(f"{_row(one, what)['declared']} of {_row(one, what)['stated']}"
                                                   for one in those))
            for what in content["watchpoints"]["stated"]
        ),
    ]  # fmt: skip


def _row(figures: Mapping[str, Any], what: str) -> Mapping[str, Any]:
    return figures["stated"][what]  # type: ignore[no-any-return]  # JSON


def _render_statements(content: Mapping[str, Any]) -> str:
    rows = []
    for what in content["watchpoints"]["stated"]:
        for by, words in NAMES.items():
            row = _row(content[by], what)
            rows.append((
                f"{what}, {words}", row["stated"], row["declared"], row["late"], row["missed"],
                row["missed_not_followed"], figure(row["delay_s_median"]), figure(row["delay_s_most"]),
                row["before_the_text"], figure(row["lead_s_median"]),
            ))  # fmt: skip
    return markdown_table(
        ("", "stated", "in time", "late", "missed", "in logs not followed", "delay median (s)", "most (s)",
         "before the text", "lead median (s)"),
        rows,
    )  # fmt: skip


def _verdicts(rows: Sequence[Mapping[str, Any]], verdict: str) -> str:
    those = [
        (row["log"], f"{one['at_s']:.1f}", f"{one['kind']}: {one['reason']}", one["evidence"], one["because"])
        for row in rows
        for one in row["declared"]
        if one["by"] == "watchpoints" and one["verdict"] == verdict
    ]
    return markdown_table(("log", "at (s)", "declared", "because", "the log says"), those) if those else ""


def _render_missed(rows: Sequence[Mapping[str, Any]]) -> str:
    those = [
        (row["log"], f"{one['at_s']:.1f}", one["what"], one["words"], one["watchpoints"]["outcome"],
         figure(one["watchpoints"]["after_s"]), "" if row["vehicles"] else "not followed")
        for row in rows
        for one in row["stated"]
        if one["watchpoints"]["outcome"] != "declared"
    ]  # fmt: skip
    columns = ("log", "at (s)", "stated", "words", "outcome", "after (s)", "")
    return markdown_table(columns, those) if those else ""


def _render_not_followed(content: Mapping[str, Any]) -> str:
    reasons = sorted(content["not_followed"].items(), key=lambda pair: -pair[1])
    reasons += [(f"the program failed: {words}", 1) for words in content["failed"]]
    return markdown_table(("reason", "logs"), reasons) if reasons else "Every log is followed."


def print_real(content: Mapping[str, Any]) -> None:
    """Print the figures of a campaign over real logs."""
    print(
        f"{content['logs']} logs, {content['followed']} followed, {content['flight_hours']:.2f} flight hours of "
        f"{content['aircraft']} aircraft"
    )
    for by, words in NAMES.items():
        row = content[by]
        print(
            f"  {words}: {row['declared']} declared, {row['confirmed']} confirmed, {row['refuted']} refuted, "
            f"{row['undecided']} undecided; refuted in 50 flight hours {_rate(row)}"
        )
        for what, found in row["stated"].items():
            print(
                f"    {what}: {found['stated']} stated, {found['declared']} in time, {found['late']} late, "
                f"{found['missed']} missed ({found['missed_not_followed']} in logs that are not followed)"
            )
    for row in content["rows"]:
        for one in row["declared"]:
            if one["by"] == "watchpoints" and one["verdict"] != "confirmed":
                print(f"  {one['verdict']}: {row['log']}, {one['at_s']:.1f} s, {one['reason']}: {one['because']}")
        for one in row["stated"]:
            if one["watchpoints"]["outcome"] != "declared":
                print(f"  {one['watchpoints']['outcome']}: {row['log']}, {one['at_s']:.1f} s, {one['words']}")
    for reason, count in content["not_followed"].items():
        print(f"  not followed: {count}, {reason}")
    for words in content["failed"]:
        print(f"  failed: {words}")
