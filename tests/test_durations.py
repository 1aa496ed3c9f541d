"""Which tests `./scripts/test` leaves out."""

from __future__ import annotations

from pathlib import Path

from tests.conftest import SLOW
from tests.durations import KEPT, ROOT, durations_s, slow_tests

REPORT = """<?xml version="1.0"?>
<testsuites><testsuite>
<testcase classname="tests.test_durations" name="test_a[one]" time="2.5" />
<testcase classname="tests.test_durations" name="test_a[two]" time="1.5" />
<testcase classname="tests.test_durations.TestB" name="test_c" time="0.5" />
</testsuite></testsuites>
"""


def test_the_longest_are_left_out_until_the_rest_fits() -> None:
    took_s = {"a.py::one": 50.0, "a.py::two": 30.0, "b.py::three": 15.0, "b.py::four": 5.0}
    assert slow_tests(took_s, fits_s=25.0) == ["a.py::one", "a.py::two"]
    assert slow_tests(took_s, fits_s=100.0) == []


def test_what_has_to_run_is_never_left_out() -> None:
    assert slow_tests(dict.fromkeys(KEPT, 500.0), fits_s=1.0) == []
    assert KEPT & set(SLOW.read_text(encoding="utf-8").splitlines()) == set()


def test_every_name_is_that_of_a_test() -> None:
    """A test that is renamed or moved takes its place in the list along: otherwise it is quick from then on."""
    gone = []
    for name in (*KEPT, *SLOW.read_text(encoding="utf-8").splitlines()):
        file, *_, function = name.split("::")
        if not (ROOT / file).is_file() or f"def {function}(" not in (ROOT / file).read_text(encoding="utf-8"):
            gone.append(name)
    assert gone == []


def test_a_report_of_pytest_is_read(tmp_path: Path) -> None:
    report = tmp_path / "all.xml"
    report.write_text(REPORT, encoding="utf-8")
    assert durations_s(report) == {
        "tests/test_durations.py::test_a": 4.0,
        "tests/test_durations.py::TestB::test_c": 0.5,
    }
