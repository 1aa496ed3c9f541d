from __future__ import annotations

import random
import re
import tomllib
from collections.abc import Iterator
from typing import Any

import pytest

from executor.plan_page.site_document import Edit, EditRefused, apply_edits, format_path
from executor.plan_page.site_history import History, read_lines, write_lines
from executor.site.site_file import parse_toml

SCATTERED = """\
# our site, 2026
[depot]                                 # where the vans stand
lat_deg = 49.5                          # WGS 84
lon_deg = 15

web.port = 8080
"quoted key" = 'literal'

[network]
file = "default"
text = \"\"\"
[[not.a.table]]
# nor a comment \"\"\"\"

[inspection]
wind_m_s = [0, 1]  # the wind
heights = [
    1,  # one
    # [two]
    2,
]

# the first one
[[vehicle]]
name = "uav1" # its name
sysid = 1
limits = { low = 1, high = [1, 2] }

# the second one
[[vehicle]]
name = "uav2"
sysid = 2

[vehicle.more]
why = "because"

[energy]
drone = "mavic3"

[[vehicle]]
name = "uav3"
sysid = 3
[day]
hours = ["08:00", "10:00"]
[[day.road]]
between = ["a", "b"]
# the end
""".replace("web.port = 8080\n\"quoted key\" = 'literal'\n\n", "")
ROOT = "title = 'x' # said\nweb.port = 8080\nlist = [{a = 1}, {a = 2}]\n\n" + SCATTERED
TEXTS = (SCATTERED, ROOT, SCATTERED.replace("\n", "\r\n"), "", "# nothing but this\n", "a = 1")


def edit(text: str, *edits: Edit) -> str:
    return apply_edits(text, edits)


def test_a_value_is_changed_and_nothing_else() -> None:
    made = edit(SCATTERED, Edit("set", ("depot", "lat_deg"), 50.123))
    assert made == SCATTERED.replace(
        "lat_deg = 49.5                          #", "lat_deg = 50.123                        #"
    )


def test_a_table_of_an_array_goes_with_its_own_comment_and_leaves_the_others() -> None:
    made = edit(SCATTERED, Edit("remove", ("vehicle", 0)))
    assert "the first one" not in made
    assert '# the second one\n[[vehicle]]\nname = "uav2"' in made
    assert made.startswith("# our site, 2026\n")
    assert made.endswith("# the end\n")


def test_a_table_is_added_after_those_of_its_array_or_before_one() -> None:
    last = edit(SCATTERED, Edit("add", ("vehicle",), {"name": "uav4", "sysid": 4}))
    assert last == SCATTERED.replace("sysid = 3\n[day]", 'sysid = 3\n\n[[vehicle]]\nname = "uav4"\nsysid = 4\n\n[day]')
    first = edit(SCATTERED, Edit("add", ("vehicle",), {"name": "uav0"}, 0))
    assert first == SCATTERED.replace("# the first one", '[[vehicle]]\nname = "uav0"\n\n# the first one')


def test_a_table_within_an_element_belongs_to_it() -> None:
    made = edit(SCATTERED, Edit("set", ("vehicle", 1, "more", "who"), "all"))
    assert made == SCATTERED.replace('why = "because"\n', 'why = "because"\nwho = "all"\n')
    assert parse_toml(edit(SCATTERED, Edit("remove", ("vehicle", 1))))["vehicle"][1]["name"] == "uav3"


def test_a_table_that_is_missing_is_made_at_the_end() -> None:
    made = edit(SCATTERED, Edit("set", ("web", "port"), 8080), Edit("add", ("area",), {"polygon": [[1.5, 2], [3, 4]]}))
    assert made == SCATTERED + "\n[web]\nport = 8080\n\n[[area]]\npolygon = [[1.5, 2], [3, 4]]\n"


def test_the_last_element_takes_its_array_along() -> None:
    assert "road" not in edit(SCATTERED, Edit("remove", ("day", "road", 0)))


def test_lines_end_as_they_did() -> None:
    made = edit(SCATTERED.replace("\n", "\r\n"), Edit("add", ("vehicle",), {"name": "uav4"}))
    assert made.count("\r\n") == made.count("\n")


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        (Edit("set", (), 1), "content: expected a path of 1 to 12 keys"),
        (Edit("set", ("vehicle", 7, "sysid"), 1), "vehicle[7]: there is no such key or value in the file"),
        (Edit("set", ("energy", "drone", "x"), 1), "energy.drone.x: expected a key of a table"),
        (Edit("remove", ("energy", "drone")), "energy.drone: expected the number of a value in a list"),
        (Edit("remove", ("vehicle", 3)), "vehicle[3]: there is no such key or value in the file"),
        (Edit("add", ("energy", "drone"), 1), "energy.drone: expected a list"),
        (Edit("add", ("vehicle",), 1), "vehicle: expected a table, as the others of this list are"),
        (Edit("set", ("vehicle", 0), 1), "vehicle[0]: expected a table, as the others of this list are"),
        (Edit("set", ("depot", "alt_m"), None), "depot.alt_m: expected a value that TOML has, got None"),
        (Edit("set", ("depot", "alt_m"), 10**30), f"depot.alt_m: expected a value that TOML has, got {10**30}"),
        (Edit("set", ("depot", "alt_m"), "\ud800"), "depot.alt_m: expected a text of whole letters"),
    ],
)
def test_what_cannot_be_done_is_refused(wrong: Edit, reason: str) -> None:
    with pytest.raises(EditRefused, match=re.escape(reason)) as refused:
        edit(SCATTERED, Edit("set", ("depot", "lat_deg"), 1), wrong)
    assert str(refused.value) == reason
    assert refused.value.path == wrong.path[: len(refused.value.path)]


def test_a_path_is_written_as_the_command_line_does() -> None:
    assert format_path(("day", "road", 0, "between")) == "day.road[0].between"


VALUES: tuple[Any, ...] = (
    1, -2.5, True, "text", "", 'quotes " and \\ and \n', "ünïcode ✓", [1, 2], [], {"a": 1}, {}, [{"a": 1}, {"b": [2]}],
    {"deep": {"er": [1]}}, 1e300, "'''", "# no comment", {"odd key.": 1},
)  # fmt: skip
KEYS = ("name", "vehicle", "new", "odd key", "day", "hours", "x-1", "é")


def draw_edits(rng: random.Random, values: dict[str, Any]) -> Iterator[Edit]:
    """Yield edits of which most can be done."""
    for _ in range(rng.randint(1, 3)):
        path: list[str | int] = []
        at: Any = values
        for _ in range(rng.randint(1, 4)):
            if isinstance(at, dict) and at and rng.random() < 0.8:
                path.append(rng.choice(sorted(at)))
            elif isinstance(at, list) and at:
                path.append(rng.randrange(len(at)))
            else:
                path.append(rng.choice(KEYS))
                break
            at = at[path[-1]]
        at_place = None if rng.random() < 0.5 else rng.randint(0, 3)
        yield Edit(rng.choice(("set", "set", "unset", "add", "remove")), tuple(path), rng.choice(VALUES), at_place)


@pytest.mark.parametrize("seed", range(200))
def test_edits_undo_and_redo_end_in_the_file_that_a_replay_of_what_remains_gives(seed: int) -> None:
    rng = random.Random(seed)
    history = History(rng.choice(TEXTS))
    for _ in range(25):
        match rng.choice(("edit", "edit", "edit", "undo", "redo")):
            case "edit":
                edits = list(draw_edits(rng, parse_toml(history.text)))
                why = ""
                try:
                    history = history.edit("drawn", edits)
                except EditRefused as error:
                    why = str(error)
                assert "cannot be written" not in why, (history.text, edits)
            case "undo":
                history = history.undo()
            case _:
                history = history.redo()
    again = history.base
    for step in history.steps[: history.done]:
        again = apply_edits(again, step.edits or ())
    assert history.text == again
    tomllib.loads(history.text)
    assert (read_lines(write_lines(history)) or (None,))[0] == history


def test_a_torn_line_and_nonsense_end_a_record() -> None:
    history = History(SCATTERED).edit("one", [Edit("set", ("a",), 1)])
    record = write_lines(history)
    assert read_lines(record + b'{"does": "undo"') == (history, False)
    assert read_lines(record + b"\xff\n") == (history, False)
    assert read_lines(record + b'{"does": "saved"}\n') == (history, True)
    assert read_lines(b"nonsense\n") is None


def test_the_oldest_steps_are_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("executor.plan_page.site_history.MOST_STEPS", 3)
    history = History("")
    for number in range(5):
        history = history.edit(f"step {number}", [Edit("set", ("a",), number)])
    assert [step.label for step in history.steps] == ["step 2", "step 3", "step 4"]
    assert history.undo().undo().undo().undo().text == "a = 1\n"
