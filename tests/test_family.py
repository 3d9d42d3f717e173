"""Families of models: a file whose function `family` makes a model from arguments."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import MODELS

from lagfmu.errors import ModelError
from lagfmu.testing import load, prepare


@pytest.mark.parametrize("n", [1, 3])
def test_a_chain_of_n_links_has_n_degrees_of_freedom(n: int) -> None:
    """2 n coordinates and n links; every link's multiplier has its closed form."""
    file = load(MODELS / "chain.py", [f"n={n}"])
    system = prepare(file.model, file.scenes[0]).system
    assert (system.nv, system.m) == (2 * n, n)
    assert file.scenes[0].name == f"Chain{n}"
    assert {c.name for c in file.closed_forms} >= {f"lambda.link{k + 1}" for k in range(n)}


def test_what_a_family_cannot_take_is_told_at_once() -> None:
    """An argument that it lacks, a value of another type, no value, and what the file itself refuses."""
    with pytest.raises(ModelError) as told:
        load(MODELS / "chain.py", ["n=four", "m=3", "n"])
    for part in ("expected an integer as the default 4 is, got 'four'", "only n=4", "NAME=VALUE"):
        assert part in str(told.value)
    with pytest.raises(ModelError, match="a chain of n = 0 links, expected at least 1"):
        load(MODELS / "chain.py", ["n=0"])


def test_a_file_without_a_family_says_how_to_write_one(tmp_path: Path) -> None:
    """The remedy stands in the message; a family that returns no model is named."""
    with pytest.raises(ModelError, match=r"no function 'family', expected def family\(n=4\)"):
        load(MODELS / "pendulum.py", ["n=2"])
    file = tmp_path / "few.py"
    file.write_text("def family(n=4, long=False):\n    return n\n")
    with pytest.raises(ModelError, match=r"family\(\) returns 5, expected a Model"):
        load(file, ["n=5", "long=yes"])
