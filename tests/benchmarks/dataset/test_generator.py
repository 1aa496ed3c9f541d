"""Generated instances: the same bytes for a seed on every Python, and files that fit their schemas."""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from benchmarks.dataset.catalogue import GENERATED, PACKAGE, find_entries, instance_path, read_references
from benchmarks.dataset.checker import read_instance
from benchmarks.dataset.generator import SHAPES, SPAN_M, format_instance, generate_instance

SHA256 = {
    "line": "08446542bc0482624fc3abd25264904b74e98b229729c3d217e4b003780e72c6",
    "ring": "cac85bdce53d134fe8bb2df899f957efd42f7ab284f90a468daf5a5b00aa5e05",
    "tree": "00bd4bd6168d86816f3265ab1c306d1169459a3112d08071a9ebf16ff60b7d1c",
    "grid": "6ddb0bce15a820975dfc91efe2967d71febd70b4d2c84fbdd99835c1b4b72178",
}
"""Of the file of 40 segments with seed 11: a change of the generator would change what others have solved."""


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_a_seed_gives_the_same_bytes_for_ever(shape: str) -> None:
    text = format_instance(generate_instance(shape, 40, 4, seed=11, budget_pct=200.0), "test")
    assert hashlib.sha256(text.encode()).hexdigest() == SHA256[shape]


@pytest.mark.parametrize("shape", sorted(SHAPES))
@pytest.mark.parametrize("segments", [3, 18, 200])
def test_a_shape_has_its_segments_each_once(shape: str, segments: int) -> None:
    made = generate_instance(shape, segments, 3, seed=5, budget_pct=100.0)
    assert len(made.segments_m) == segments
    assert len({frozenset(ends) for ends in made.segments_m}) == segments
    lengths = [math.dist(first, last) for first, last in made.segments_m]
    assert max(lengths) < 1.4 * SPAN_M[1]
    assert made.name == f"{shape}-{segments}-3-seed5"


def test_other_seeds_give_other_lines() -> None:
    first, second = (generate_instance("tree", 18, 3, seed=seed, budget_pct=100.0) for seed in (1, 2))
    assert first.segments_m != second.segments_m


@pytest.mark.parametrize("one", GENERATED, ids=lambda one: f"{one.shape}-{one.segments}")
def test_the_files_of_the_package_are_what_the_generator_makes(one: Any) -> None:
    assert instance_path(one.build().name).read_text(encoding="utf-8") == format_instance(one.build(), one.source)


def schema(name: str) -> Draft202012Validator:
    content = json.loads((PACKAGE / "schemas" / f"{name}.schema.json").read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(content)
    return Draft202012Validator(content)


def test_every_file_of_the_package_fits_its_schema() -> None:
    instances = schema("instance")
    for path in sorted((PACKAGE / "instances").glob("*.json")):
        instances.validate(json.loads(path.read_text(encoding="utf-8")))
    solutions = schema("solution")
    for path in find_entries():
        solutions.validate(json.loads(path.read_text(encoding="utf-8")))


def test_what_a_schema_refuses_the_reader_refuses_too() -> None:
    good = json.loads(instance_path("tree-18-3").read_text(encoding="utf-8"))
    for key in good:
        without = {name: value for name, value in good.items() if name != key}
        if not schema("instance").is_valid(without):
            with pytest.raises(Exception, match=key):
                read_instance(without)


def test_the_package_stays_small_and_holds_no_public_file() -> None:
    files = [path for path in PACKAGE.rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    assert sum(path.stat().st_size for path in files) < 2_000_000
    public = {Path(one.file).name for one in read_references()}
    assert public.isdisjoint(path.name for path in files)
