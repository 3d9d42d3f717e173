"""What a variable may be set to is said in the same words by Python, by the FMU's C and by the page."""

from __future__ import annotations

import math

import pytest
from instance import instance

from lagfmu import simulate
from lagfmu.errors import SettingError
from lagfmu.testing import described_rules, problems_of, read_description

BAD = {  # of the hemisphere
    "theta": [math.nan, math.inf],
    "a": [-1.0, 0.0],  # a radius
    "solver.tolerance": [-1e-6, 2.0],
    "lambda.surface": [1.0],
}


@pytest.fixture(scope="module")
def path(native_fmu):
    return native_fmu("Hemisphere")


@pytest.mark.parametrize(("name", "value"), [(n, v) for n, values in BAD.items() for v in values])
def test_python_says_what_the_fmu_says(path, name, value):
    """No radius is negative and no angle infinite: the FMU's own words, before it is asked."""
    with instance(path) as one:
        with pytest.raises(Exception, match="fmi2SetReal"):
            one.set(name, value)
        (said,) = [text for status, _, text in one.log if status >= 2]
    rules = described_rules(read_description(path))
    told = problems_of(rules, {name: value})
    if not rules[name].settable:
        assert told[0].startswith("'lambda.surface' cannot be set")
    elif told:  # the description does not say that zero is none
        assert told == [said]
    else:
        assert value == 0
        assert said == "'a' = 0.0, expected a positive number"
    with pytest.raises(SettingError) if told else pytest.raises(Exception, match="positive"):
        simulate(path, 0.1, start_values={name: value})


def test_all_problems_are_told_at_once(path):
    """Two radii and a name that is none, in one message."""
    with pytest.raises(SettingError) as told:
        simulate(path, 0.1, start_values={"a": -1.0, "m": math.nan, "thta": 0.1})
    for text in ("'a' = -1.0 is outside", "'m' = nan, expected a finite", "did you mean 'theta'?"):
        assert text in str(told.value)
