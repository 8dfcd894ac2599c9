"""How the worth of a cut is reckoned that a diagnosis asks for; that it is worth more is no matter of a test."""

import numpy as np
import pytest

from benchmarks.blind.judgement import Case
from benchmarks.blind.next_cuts import rival_of, table, worth


def test_the_rival_is_what_was_most_probable_beside_the_truth():
    shares = {"none": 0.2, "holder_joint": 0.5, "ring_expansion": 0.3}
    told = {"seed": 1, "kind": "one", "strength": 1.0, "flips": 0.0, "data": "cuts alone", "probabilities": shares}
    assert rival_of(Case(**told, effects=("holder_joint",))) == "ring_expansion"
    assert rival_of(Case(**told, effects=("ring_expansion",))) == "holder_joint"
    assert rival_of(Case(**told, effects=("process_damping",))) == "holder_joint"


def test_a_label_is_worth_what_it_is_more_probable_by_the_truth():
    by_truth, by_rival = np.array([0.9, 0.9, 0.5]), np.array([0.1, 0.1, 0.5])
    assert worth(np.array([True, False, True]), by_truth, by_rival) == pytest.approx([np.log(9.0), -np.log(9.0), 0.0])
    # Where the truth's own probabilities hold, labels speak for it on the average: the divergence of one by the other.
    mean = by_truth * worth(True, by_truth, by_rival) + (1.0 - by_truth) * worth(False, by_truth, by_rival)
    assert mean == pytest.approx([0.8 * np.log(9.0), 0.8 * np.log(9.0), 0.0])


def test_the_table_tells_apart_what_is_nearly_tied():
    row = {"expected_nats": 1.0, "asked_nats": 2.0, "kept_back_nats": 0.25, "more_than": 0.9}
    told = table([{**row, "apart_nats": 4.0}, {**row, "apart_nats": -30.0}])
    interval = "{0} ({0} to {0})".format
    cells = " | ".join(interval(value) for value in ("1.00", "2.00", "0.25"))
    assert told[2:] == [f"| all | 2 | {cells} | 90% |", f"| apart by 5 nats at most | 1 | {cells} | 90% |"]
