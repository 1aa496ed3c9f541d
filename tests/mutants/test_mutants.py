"""The mutation run on a toy: what is noticed, what is not, and what is known to make no difference."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.mutants.judge import AlreadyFailing, Limits
from tests.mutants.modules import MODULES, Module
from tests.mutants.mutate import Verdict, mutants, readable
from tests.mutants.quick import swaps
from tests.mutants.run import (  # fmt: skip
    EQUIVALENTS,
    BadList,
    Candidate,
    Key,
    Results,
    at_place,
    candidates,
    chosen,
    equivalents,
    run,
)

ROOT = Path(__file__).parents[2]
TOY = """
LIMIT = 10


def over(value: int) -> bool:
    return value > LIMIT


def waits(value: int) -> int:
    while value < 3:
        value += 1
    return value


def unseen(value: int) -> int:
    return value + 5
"""
TOY_TESTS = """
from toy import over, waits


def test_over():
    assert over(12)
    assert not over(3)


def test_waits():
    assert waits(0) == 3
"""
TOYS = {"toy": Module(("toy.py",), ("test_toy.py",), readers=("toy.py",))}


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "toy.py").write_text(TOY)
    (tmp_path / "test_toy.py").write_text(TOY_TESTS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def judged(toy: Path, *afters: str, reasons: Mapping[Key, str] | None = None) -> Results:
    """Judge the changes of the toy after which a line reads so."""
    todo = [one for one in candidates(TOYS, toy) if one.key[2] in afters]
    assert len(todo) == len(afters)
    return run(todo, TOYS, reasons or {}, toy / "store", Limits(slack_s=8.0))


def test_what_the_tests_show_is_killed_and_what_they_leave_open_survives(
    toy: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    results = judged(
        toy, "return value <= LIMIT", "return value >= LIMIT", "return value + 6", "LIMIT = 0", "value += 0"
    )
    assert {one.key[2]: verdict for one, verdict in results.judged} == {
        "return value <= LIMIT": Verdict.KILLED,
        "return value >= LIMIT": Verdict.SURVIVED,
        "return value + 6": Verdict.SURVIVED,
        "LIMIT = 0": Verdict.KILLED,
        "value += 0": Verdict.TIMED_OUT,
    }
    assert results.rate() == 0.6
    assert "toy.py:6 in over\n- return value > LIMIT\n+ return value >= LIMIT\n" in capsys.readouterr().out
    assert (toy / "toy.py").read_text() == TOY


def test_what_is_known_to_make_no_difference_is_counted_apart(toy: Path) -> None:
    known = ("toy.py:over", "return value > LIMIT", "return value >= LIMIT")
    results = judged(toy, "return value >= LIMIT", "return value <= LIMIT", reasons={known: "nobody asks at the limit"})
    assert {one.key == known: verdict for one, verdict in results.judged} == {
        True: Verdict.EQUIVALENT,
        False: Verdict.KILLED,
    }
    assert results.rate() == 1.0
    assert results.lines()[-1].split() == ["all", "2", "1", "0", "0", "1", "100.0%"]


def test_tests_that_fail_by_themselves_judge_nothing(toy: Path) -> None:
    (toy / "test_toy.py").write_text("def test_it():\n    assert False\n")
    with pytest.raises(AlreadyFailing, match="test_toy"):
        judged(toy, "LIMIT = 0")


def test_what_was_learnt_holds_until_the_test_changes(toy: Path) -> None:
    first = judged(toy, "return value >= LIMIT")
    (toy / "test_toy.py").write_text(TOY_TESTS.replace("over(3)", "over(10)"))
    second = judged(toy, "return value >= LIMIT")
    assert [results.judged[0][1] for results in (first, second)] == [Verdict.SURVIVED, Verdict.KILLED]
    assert len(list((toy / "store").iterdir())) == 2


def test_objects_that_a_test_made_at_import_are_made_again(toy: Path) -> None:
    text = "from toy import over\n\nSEEN = over(12)\n\n\ndef test_seen():\n    over(12)\n    assert SEEN\n"
    (toy / "test_toy.py").write_text(text)
    results = judged(toy, "return value <= LIMIT", "return value >= LIMIT")
    assert {one.key[2]: verdict for one, verdict in results.judged} == {
        "return value <= LIMIT": Verdict.KILLED,
        "return value >= LIMIT": Verdict.SURVIVED,
    }


@pytest.mark.parametrize(
    ("before", "after", "exchanged"),
    [
        ("def f():\n    return 1\n", "def f():\n    return 2\n", ["f"]),
        ("def f():\n    return 1\n", "def f():\n    return 1\n", []),
        ("class A:\n    def f(self):\n        return 1\n", "class A:\n    def f(self):\n        return 2\n", ["A.f"]),
        ("def f(a=1):\n    return a\n", "def f(a=2):\n    return a\n", None),
        ("B = 1\n", "B = 2\n", None),
        ("class A:\n    b = 1\n", "class A:\n    b = 2\n", None),
        ("g = lambda: 1\n", "g = lambda: 2\n", ["<lambda>"]),
    ],
)
def test_which_functions_are_exchanged(before: str, after: str, exchanged: list[str] | None) -> None:
    found = swaps(compile(before, "a.py", "exec"), compile(after, "a.py", "exec"))
    assert (None if found is None else [old.co_qualname for old, _ in found]) == exchanged


def test_the_seed_decides_the_choice(toy: Path) -> None:
    found = candidates(TOYS, toy)
    assert chosen(found, 5, 1) == chosen(found, 5, 1) != chosen(found, 5, 2)
    assert all(readable(one.mutant, one.text) for one in chosen(found, len(found), 1))
    assert {one.mutant.line for one in at_place(found, "toy.py:6")} == {6}


LINES = [
    ("a < b", ["a <= b", "a >= b"]),
    ("x is not None", ["x is None"]),
    ("x + y * 2", ["x - y * 2", "x + y / 2", "x + y * 3", "x + y * 1", "x + y * 0"]),
    ("p and q", ["p or q"]),
    ("p and q and r", ["p and q or r", "p and r", "q and r"]),
    ("not p", ["p"]),
    ("-x", ["x"]),
    ("a if p else b", ["a if (not (p)) else b"]),
    ("[a for a in b if a]", ["[a for a in b if (not (a))]"]),
    ("replace(a, b=c, d=e)", ["replace(a, d=e)", "replace(a, b=c)"]),
    ("other(a, b=True)", ["other(a, b=False)"]),
    ("'words', f'{1 + 1}'", []),
]


@pytest.mark.parametrize(("before", "afters"), LINES, ids=[before for before, _ in LINES])
def test_the_changes_of_an_expression(before: str, afters: list[str]) -> None:
    text = f"w = ({before})\n".encode()
    found = [mutant.difference(text)[1] for mutant in mutants("a.py", text)]
    assert sorted(found) == sorted(f"w = ({after})" for after in afters)


def test_the_changes_of_statements() -> None:
    text = b"def f(x: int | None) -> bool:\n    x = 'a'\n    y = x\n    if y:\n        go(y)\n    return y\n"
    assert {mutant.difference(text) for mutant in mutants("a.py", text)} == {
        ("x = 'a'", "pass"),
        ("if y:", "if (not (y)):"),
        ("go(y)", "pass"),
        ("return y", "return True"),
        ("return y", "return False"),
    }


BAD_LISTS = [
    ('in = "toy.py:over"\nbefore = "a"\nafter = "b"\nreason = ""', "expected reason"),
    ('in = "toy.py:over"\nbefore = "a"\nafter = "b"\nreason = "c"', "no such change any more: a"),
]


@pytest.mark.parametrize(("entry", "why"), BAD_LISTS)
def test_a_list_of_equivalents_that_says_nothing_is_refused(toy: Path, entry: str, why: str) -> None:
    (toy / "list.toml").write_text(f"[[equivalent]]\n{entry}\n")
    with pytest.raises(BadList, match=why):
        equivalents(toy / "list.toml", candidates(TOYS, toy))


def test_the_list_of_this_project_is_true_to_its_files() -> None:
    found: list[Candidate] = candidates(MODULES, ROOT)
    assert {one.module for one in found} == set(MODULES)
    equivalents(EQUIVALENTS, found)
