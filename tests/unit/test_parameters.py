"""What a parameter says of itself: where a search steps to from its null, and what it refuses."""

import pytest

from chatter_core.errors import InvalidInput
from chatter_core.parameters import Parameter


def declared(**own):
    return Parameter(**{"name": "size", "unit": "um", "doc": "", "prior_width": 2.0, **own})


@pytest.mark.parametrize(("own", "expected"), [
    ({}, 1.0), ({"lower": 0.0}, 1.0), ({"upper": 0.4}, 0.4),
    ({"upper": 0.0}, -1.0), ({"lower": -0.3, "upper": 0.0}, -0.3),
])  # fmt: skip
def test_a_step_aside_goes_up_or_down_where_it_cannot(own, expected):
    assert declared(**own).aside(0.5) == expected


def test_a_search_begins_at_multiples_of_its_own_width_or_the_priors():
    assert declared().searched_by == 2.0
    assert declared(search_width=0.5).searched_by == 0.5
    assert declared(search_width=0.5).searched_at(-3.0) == -1.5
    assert declared(search_width=0.5, upper=0.0).searched_at(3.0) == -1.5


@pytest.mark.parametrize("key", ["prior_width", "search_width"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_a_width_is_a_number_above_zero(key, value):
    with pytest.raises(InvalidInput, match=rf"parameter size: {key}: found .*, allowed: above 0"):
        declared(**{key: value})
