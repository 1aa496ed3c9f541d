"""What the documents say is so: pages that are made, files, links, site files and command lines in them."""

from __future__ import annotations

import re
import shlex
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from executor.cli import commandline
from executor.cli.exit_codes import INTERNAL, INTERRUPTED
from executor.cli.main import main
from executor.site.site_file import Site, check_site
from scripts.pages import reference
from simulator.errors import FaultSpecError
from simulator.fault_kinds import parse_fault

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
EXECUTOR = ROOT / "executor"
PAGES = sorted(DOCS.rglob("*.md"))
TEXTS = [ROOT / "README.md", ROOT / "ARCHITECTURE.md", ROOT / "CHANGELOG.md", *PAGES]
FENCED = re.compile(r"^( *)```(\w*)[^\n]*\n(.*?)^\1```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")
PLACED = re.compile(r"`((?:executor|missions|planner|tests|docs|scripts)/[\w./-]+|mkdocs\.yml)`")

GLANCE = (DOCS / "reference" / "commands.md").read_text(encoding="utf-8")
OWN_LINE = (DOCS / "tutorials" / "own-line.md").read_text(encoding="utf-8")
WHERE = (DOCS / "where.md").read_text(encoding="utf-8")
SITE = re.search(r"```toml\n(.*?)```", OWN_LINE, re.DOTALL)
ROWS = re.findall(r"^\| (`faultline .*?) \|", GLANCE, re.MULTILINE)
CALLS = [call for row in ROWS for call in re.findall(r"`faultline ([^`]*)`", row)]
NEEDS_VEHICLES = ("simulate", "fly", "day", "preflight", "resume", "restore", "demo", "open")
NEEDS_LOGS_OR_HOURS = ("replay", "images", "bench")
RUNS = [call for call in CALLS if not call.startswith((*NEEDS_VEHICLES, *NEEDS_LOGS_OR_HOURS))]
LEAST_SITE = {
    "network": {"file": "default"},
    "vehicle": [{"name": "uav1", "connection": "udpin://0.0.0.0:14999", "sysid": 9, "autopilot": "px4"}],
}
"""What a table that is shown alone is put into."""


def named(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def call(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[object, str]:
    with pytest.raises(SystemExit) as ended:
        main(words)
    return ended.value.code, "".join(capsys.readouterr())


def fenced(path: Path) -> Iterator[tuple[str, str]]:
    """Yield the language and the content of each fenced block, as it stands without its indent."""
    for indent, language, content in FENCED.findall(path.read_text(encoding="utf-8")):
        yield language, re.sub(rf"^{indent}", "", content, flags=re.MULTILINE)


def command_lines(path: Path) -> Iterator[str]:
    """Yield each call of the program that a document shows, in blocks and between backticks."""
    text = path.read_text(encoding="utf-8")
    for _, content in fenced(path):
        for line in re.sub(r"\\\n\s*", " ", content).splitlines():
            words = line.strip().removeprefix("$ ").partition("  #")[0].strip()
            if words.startswith(("faultline ", "./scripts/demo ")):
                yield words.replace("./scripts/demo", "faultline demo")
    yield from re.findall(r"`(faultline [a-z][^`]*)`", re.sub(FENCED, "", text))


COMMANDS = {name: {opt for one in command.params for opt in one.opts} for name, command in reference.commands()}
OVERVIEW = {"faultline": {opt for one in commandline.cli.params for opt in one.opts}}
SAID = sorted({(named(path), line) for path in TEXTS for line in command_lines(path)})
SNIPPETS = [(named(path), content) for path in TEXTS for language, content in fenced(path) if language == "toml"]


MADE = reference.pages()


@pytest.mark.parametrize("name", MADE)
def test_what_is_made_from_the_program_is_current(name: str) -> None:
    """`./scripts/reference` makes it anew."""
    assert (DOCS / name).read_text(encoding="utf-8") == MADE[name]


def test_every_schema_is_made_from_the_program() -> None:
    schemas = {path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.schema.json")}
    assert schemas == {name for name in MADE if name.endswith(".schema.json")}


def test_every_key_of_a_site_file_is_in_its_reference_with_a_meaning() -> None:
    schema = Site.model_json_schema()
    tables = {name: set(table["properties"]) for name, table in schema["$defs"].items() if "enum" not in table}
    page = reference.site_page()
    rows = re.findall(r"^\| `(\w+)` \|.*\| (.*?) \|$", page, re.MULTILINE)
    assert sorted(key for key, _ in rows) == sorted(key for keys in tables.values() for key in keys)
    assert [key for key, meaning in rows if len(meaning) < 5] == []


def test_every_command_is_in_its_reference() -> None:
    headings = set(re.findall(r"^## (faultline .*)$", reference.commands_page(), re.MULTILINE))
    assert headings == set(COMMANDS)
    assert {"faultline fly", "faultline bench fleet"} <= headings


def test_every_command_is_in_the_table_and_no_call_twice() -> None:
    shown = {name for name in COMMANDS if any(f"faultline {call} ".startswith(f"{name} ") for call in CALLS)}
    assert shown == set(COMMANDS)
    assert sorted(set(CALLS)) == sorted(CALLS)


def test_there_is_something_to_try() -> None:
    assert len(RUNS) >= 8
    assert RUNS[2].startswith("plan SITE -o plan.json")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the tutorial's site file, and one that tunes the search."""
    assert SITE is not None
    folder = tmp_path_factory.mktemp("docs")
    (folder / "site.toml").write_text(SITE.group(1), encoding="utf-8")
    (folder / "search.toml").write_text("[annealing]\nhot = 8.0\n\n[window]\nprobes = 6\n", encoding="utf-8")
    return folder


@pytest.mark.parametrize("said", RUNS)
def test_a_call_of_the_table(
    said: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    names = {"SITE": "site.toml", "PLAN": "plan.json", "DIR": "out", "NETWORK": "default", "FILE": "search.toml"}
    if said.startswith("init"):
        names["SITE"] = "new.toml"
    if not Path("plan.json").exists():
        call(capsys, "plan", "site.toml", "--seconds", "0.5", "-o", "plan.json")
    words = [names.get(word, word) for word in shlex.split(said)]
    if words[0] == "plan":
        words += ["--seconds", "2"]
    if words[0] == "risk":
        words += ["--samples", "500", "--jobs", "1"]
    code, text = call(capsys, *words)
    assert code == 0, text


def test_the_site_of_the_tutorial_is_what_init_writes(capsys: pytest.CaptureFixture[str]) -> None:
    assert SITE is not None
    code, text = call(capsys, "init", "default", "--radius", "1500")
    assert (code, text) == (0, SITE.group(1))


@pytest.mark.parametrize(("place", "content"), SNIPPETS, ids=[place for place, _ in SNIPPETS])
def test_what_is_shown_of_a_site_file_is_one(place: str, content: str) -> None:
    """A table that is shown alone is one of a whole site file, too."""
    tables: dict[str, Any] = tomllib.loads(content)
    check_site({**LEAST_SITE, **tables}, place)


@pytest.mark.parametrize(("place", "said"), SAID)
def test_a_command_line_is_one(place: str, said: str) -> None:
    """Its command is there, and so are its options."""
    words = shlex.split(said)
    known = COMMANDS | OVERVIEW
    name = next((name for name in map(" ".join, (words[:3], words[:2])) if name in known), words[0])
    if name == "faultline bench":
        pytest.fail(f"{place}: {said!r}: expected a command of bench")
    assert name != "faultline" or words[1].startswith("--"), place
    options = {word.partition("=")[0] for word in words[1:] if re.match(r"--?[a-z]", word)}
    assert options - known[name] - {"--help"} == set(), place


@pytest.mark.parametrize("path", TEXTS, ids=named)
def test_every_link_to_a_file_leads_somewhere(path: Path) -> None:
    links = LINK.findall(re.sub(FENCED, "", path.read_text(encoding="utf-8")))
    files = [link.partition("#")[0] for link in links if not re.match(r"[a-z]+:", link) and not link.startswith("#")]
    assert [file for file in files if not (path.parent / file).exists()] == []


def anchors(path: Path) -> set[str]:
    """Return what can stand behind # in a link to a page: its headings, as the site writes them."""
    headings = re.findall(r"^#+ (.+)$", re.sub(FENCED, "", path.read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", heading).strip().lower()) for heading in headings}


@pytest.mark.parametrize("path", TEXTS, ids=named)
def test_every_link_to_a_heading_leads_somewhere(path: Path) -> None:
    links = LINK.findall(re.sub(FENCED, "", path.read_text(encoding="utf-8")))
    found = [link.partition("#") for link in links if "#" in link and not re.match(r"[a-z]+:", link)]
    assert [(file, name) for file, _, name in found if name not in anchors(path.parent / file if file else path)] == []


def test_a_page_links_to_no_file_that_the_site_does_not_have() -> None:
    outside = [
        (named(page), link)
        for page in PAGES
        for link in LINK.findall(re.sub(FENCED, "", page.read_text(encoding="utf-8")))
        if not re.match(r"[a-z]+:|#", link) and not (page.parent / link).resolve().is_relative_to(DOCS)
    ]
    assert outside == []


def test_every_page_has_its_place_in_the_site() -> None:
    nav = YAML(typ="safe").load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]

    def files(part: object) -> Iterator[str]:
        if isinstance(part, str):
            yield part
        for one in part.values() if isinstance(part, dict) else part if isinstance(part, list) else ():
            yield from files(one)

    assert sorted(files(nav)) == sorted(page.relative_to(DOCS).as_posix() for page in PAGES)


def test_every_exit_code_is_in_its_reference() -> None:
    """130 is the shell's name for an end by SIGINT."""
    page = (DOCS / "reference" / "exit-codes.md").read_text(encoding="utf-8")
    assert [int(code) for code in re.findall(r"^\| (\d+) \|", page, re.MULTILINE)] == [0, 1, 2, INTERNAL, INTERRUPTED]


def test_every_file_of_a_run_directory_is_in_its_reference() -> None:
    """Their names stand in what flies, what reports, what simulates."""
    page = (DOCS / "reference" / "run-directory.md").read_text(encoding="utf-8")
    writers = [path for folder in ("flight", "analysis", "simulated") for path in (EXECUTOR / folder).rglob("*.py")]
    writers += [EXECUTOR / "supervised.py", EXECUTOR / "cli" / "flights.py", EXECUTOR / "adapters" / "run_directory.py"]
    pattern = re.compile(r'"([a-z0-9-]*\.(?:jsonl?|toml|html|png|txt|log|lock))"')
    names = {name for path in writers for name in pattern.findall(path.read_text(encoding="utf-8"))}
    assert len(names) >= 12
    assert [name for name in sorted(names - {".lock"}) if f"`{name}`" not in page] == []


def test_the_glossary_has_each_word_once_in_order() -> None:
    text = (DOCS / "glossary.md").read_text(encoding="utf-8")
    words = [word.casefold() for word in re.findall(r"^\| \*\*(.+?)\*\* \|", text, re.MULTILINE)]
    assert words == sorted(set(words))


def test_where_answers_many_questions() -> None:
    assert len(re.findall(r"^\| (?!where |---)", WHERE, re.MULTILINE)) >= 40


@pytest.mark.parametrize("file", sorted(set(PLACED.findall(WHERE))))
def test_a_file_that_where_names_is_there(file: str) -> None:
    assert (ROOT / file).exists()


def test_a_file_that_the_architecture_names_is_there() -> None:
    """It leaves out `executor/`."""
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    files = set(re.findall(r"`([a-z]\w*/[\w./-]+)`", text))
    assert len(files) > 30
    assert [
        file for file in sorted(files) if not any((ROOT / above / file).exists() for above in ("", "executor"))
    ] == []


def test_the_sizes_in_the_architecture_are_what_the_script_counts() -> None:
    """Within 3 %; `./scripts/size` prints the table anew."""
    printed = subprocess.run([ROOT / "scripts" / "size"], check=True, capture_output=True, text=True).stdout
    row = re.compile(r"^\| (\S+) \| (\d+) \|$", re.MULTILINE)
    counted = {name: int(lines) for name, lines in row.findall(printed)}
    _, _, section = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8").partition("## Size\n")
    stated = {name: int(lines) for name, lines in row.findall(section)}
    assert len(counted) == 8
    assert stated == {name: pytest.approx(lines, rel=0.03) for name, lines in counted.items()}


def test_where_names_every_script() -> None:
    scripts = {
        f"scripts/{path.name}"
        for path in (ROOT / "scripts").iterdir()
        if path.suffix not in (".sh", ".py") and path.name != "__pycache__"
    }
    assert scripts - set(PLACED.findall(WHERE)) == set()


def test_where_names_every_kind_of_fault() -> None:
    """The simulator's own refusal lists them."""
    with pytest.raises(FaultSpecError, match="unknown kind") as refused:
        parse_fault("uav1:nothing@0s")
    kinds = str(refused.value).partition("expected one of ")[2].split(", ")
    assert len(kinds) >= 20
    assert [kind for kind in kinds if f"`{kind}`" not in WHERE] == []


def test_no_page_asks_for_anything_from_the_network() -> None:
    """Pictures and scripts come with the documents; a link is followed by who clicks on it."""
    pattern = re.compile(r"!\[[^\]]*\]\(https?:|<(?:img|script|iframe)\b")
    assert [named(path) for path in TEXTS if pattern.search(path.read_text(encoding="utf-8"))] == []
