from __future__ import annotations

from pathlib import Path

from scripts.installations import make_table

RUN = """<testsuites><testsuite>
<testcase name="test_it_answers[python3.11 lowest-direct]"><properties><property name="versions" value="numpy 2.1.0"/>
</properties></testcase>
<testcase name="test_it_flies[python3.11 lowest-direct]"><failure message="no"/></testcase>
<testcase name="test_it_answers[python3.14 highest]"/>
<testcase name="test_every_system[x86_64-manylinux_2_28-3.11]"/>
</testsuite></testsuites>"""
AGAIN = '<testsuites><testcase name="test_it_flies[python3.11 lowest-direct]"/></testsuites>'


def test_a_column_for_each_environment_and_a_row_for_each_test_in_it(tmp_path: Path) -> None:
    (tmp_path / "run.xml").write_text(RUN, encoding="utf-8")
    assert make_table([tmp_path / "run.xml"]).splitlines() == [
        "|  | 3.11, lowest | 3.14, newest |",
        "| --- | --- | --- |",
        "| versions | numpy 2.1.0 | not run |",
        "| it answers | yes | yes |",
        "| it flies | failure | not run |",
    ]


def test_the_last_run_of_a_test_counts(tmp_path: Path) -> None:
    (tmp_path / "run.xml").write_text(RUN, encoding="utf-8")
    (tmp_path / "again.xml").write_text(AGAIN, encoding="utf-8")
    assert "| it flies | yes | not run |" in make_table([tmp_path / "run.xml", tmp_path / "again.xml"])
