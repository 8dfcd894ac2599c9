"""Where the fit of an effect begins: a search that knows nothing ends no lower than a fit that begins at the truth."""

from dataclasses import replace

import numpy as np
import pytest

from chatter_core.effects import Scan
from chatter_core.effects.variable_pitch import LOOKED_AT, WAVES, VariablePitch
from chatter_core.evidence import CampaignModel, Comparison, base_model
from chatter_core.evidence.candidates import Candidate, extended
from chatter_core.evidence.fit import free_parameters, maximise
from chatter_core.evidence.measured import OUTCOMES
from chatter_core.evidence.pursuit import LEFT_GAIN, fit_hypothesis, ground, look, pursue, refit
from chatter_core.evidence.starts import (
    SCREENED,
    SLIGHT_AMPLITUDES,
    SMALLEST_PROMISE,
    Worth,
    chosen,
    other_shapes,
    waves_between_teeth,
)
from tests.synthetic import RPM, campaign, measured, tip_machine, trials
from tests.unit.test_candidates import base_of, candidate

SLOW, FAST = np.linspace(1500.0, 4000.0, 22) * RPM, np.linspace(5000.0, 16000.0, 22) * RPM
MIDDLE = np.linspace(2500.0, 8000.0, 22) * RPM
DEPTHS = np.geomspace(5e-4, 8e-3, 8)
PITCH, ALONG, ACROSS = candidate("variable_pitch"), candidate("workpiece_mode"), candidate("workpiece_mode", 1)
RUNOUT, SINUSOIDAL = candidate("tool_runout"), candidate("variable_pitch", 2)
#: Where modes of 600 and 660 Hz leave no more than so many waves between two teeth, in most of the cuts.
FEW_WAVES = 6.0
assert PITCH.scan is not None
FEWER = replace(PITCH, scan=(PITCH.scan[0], VariablePitch.scan.with_waves(FEW_WAVES)))
FEW_OF_THREE = replace(SINUSOIDAL, scan=FEWER.scan)


def judged(new: Candidate, speeds, true, teeth=2):
    """A campaign whose labels are those of the model with an effect, without noise and without chatter frequencies."""
    speed, depth = (axis.ravel() for axis in np.meshgrid(speeds, DEPTHS, indexing="ij"))
    machine = tip_machine(teeth=teeth)
    plan = campaign(machine, trials=trials(speed, depth))
    model = CampaignModel(campaign=plan, terms=(new.term,))
    values = np.array([true.get(p.name.split(".")[-1], p.null) for p in model.parameters])
    chatter = model.predict(values, quantities=("outcome",)).margin > 0.0
    outcome = np.where(chatter, OUTCOMES.index("chatter"), OUTCOMES.index("stable")).astype(np.int8)
    return replace(plan, trials=replace(plan.trials, outcome=outcome))


@pytest.mark.parametrize(
    ("new", "speeds", "true"),
    [
        (PITCH, SLOW, {"variation": 0.07}),
        (FEWER, MIDDLE, {"variation": 0.2}),
        (ACROSS, FAST, {"compliance_um_n": 0.03, "natural_frequency_hz": 960.0, "damping_ratio": 0.015}),
        (ALONG, FAST, {"compliance_um_n": 0.1, "natural_frequency_hz": 900.0, "damping_ratio": 0.03}),
    ],
    ids=[
        "little pitch",
        "much pitch of few waves",
        "a weak mode",
        "a soft mode",
    ],
)
def test_the_search_ends_no_lower_than_a_fit_from_the_truth(new, speeds, true):
    base = base_of(judged(new, speeds, true))
    near = fit_hypothesis(base.comparison, [new], ground(base))
    found = refit(near, near.fit)
    at_truth = np.array([true.get(p.name.split(".")[-1], p.null) for p in found.fit.parameters])
    free = free_parameters(found.comparison, (), at_truth)
    ended = maximise(found.comparison, [at_truth], free, 1, LEFT_GAIN).log_posterior
    # What names an effect: without that there would be nothing to be missed.
    assert ended > base.fit.log_posterior + 9.0
    # Two climbs in a posterior with edges may differ by twice what its roughness is, one nat.
    assert found.fit.log_posterior > ended - 2.0


def test_of_three_teeth_one_pitch_that_is_narrow_is_found():
    """Each strength is looked at with one that is wide and with one that is narrow, and from the best it is found."""
    base = base_of(judged(FEW_OF_THREE, MIDDLE[::3] * 2.0 / 3.0, {"variation": 0.3, "phase_deg": 60.0}, teeth=3))
    prospect = look(base.comparison, [FEW_OF_THREE], ground(base))
    names = [p.name for p in prospect.climb.problem.parameters]
    own = [names.index(p.name) for p in FEW_OF_THREE.term.parameters]
    phases = FEW_OF_THREE.scanned_shapes
    looked_at = {tuple(start[own]) for _, start in prospect.starts if start[own[0]] > 0.0}
    assert looked_at == {(value, phase) for value in FEW_OF_THREE.scan[1] for phase in phases}
    near = pursue(prospect)
    found = refit(near, near.fit)
    # What names an effect.
    assert found.fit.log_posterior > base.fit.log_posterior + 9.0


def test_the_pitch_that_promises_most_is_found_as_if_teeth_forced_no_motion():
    """Of all pitches a few are looked at with that motion, and the best of all, by it, is among them."""
    base = base_of(judged(FEWER, MIDDLE, {"variation": 0.2}))
    prospect = look(base.comparison, [FEWER], ground(base))
    worth = Worth(prospect.climb, prospect.at_null, prospect.known, prospect.added)
    place = [p.name for p in prospect.climb.problem.parameters].index(PITCH.scan[0])
    # The first are beside the base model, those behind beside the machine as described.
    told = {start[place]: promise for promise, start in reversed(prospect.starts)}
    looked_at = {value: promise for value, promise in told.items() if promise > -np.inf}
    assert len(looked_at) == 1 + SCREENED < len(FEWER.scan[1])
    # The others part peaks.
    assert set(told) == {0.0, *FEWER.scan[1]}
    everywhere = {}
    for value in FEWER.scan[1]:
        start = prospect.at_null.values.copy()
        start[place] = value
        everywhere[value] = worth.of(start)
    best = max(everywhere, key=everywhere.get)
    assert looked_at[best] == everywhere[best]
    # It is the motion that is left out: teeth that are all alike force none.
    assert worth.still.of(start) != everywhere[value]
    assert worth.still.of(prospect.at_null.values) == worth.of(prospect.at_null.values)


def test_of_runout_those_starts_are_looked_at_on_the_motion_that_promise_most_without_it():
    base = base_of(judged(RUNOUT, FAST[::2], {"runout_um": 60.0, "phase_deg": 40.0}))
    prospect = look(base.comparison, [RUNOUT], ground(base))
    worth = Worth(prospect.climb, prospect.at_null, prospect.known, prospect.added)
    # The null is no start that makes teeth unlike.
    starts = [(promise, start) for promise, start in prospect.starts if worth.makes_teeth_unlike(start)]
    looked_at = {id(start): promise for promise, start in starts if promise > -np.inf}
    assert len(looked_at) == SCREENED < len(starts) == len(prospect.starts) - 1
    still = sorted(starts, key=lambda one: -worth.still.of(one[1]))
    assert set(looked_at) == {id(start) for _, start in still[:SCREENED]}
    everywhere = {id(start): worth.of(start) for _, start in starts}
    best = max(everywhere, key=everywhere.get)
    # It is climbed from.
    assert looked_at[best] == everywhere[best] > SMALLEST_PROMISE


@pytest.mark.parametrize(("heard", "bent", "beside"), [(False, False, True), (True, False, False), (True, True, True)])
def test_pitches_are_looked_at_beside_the_machine_as_described_where_nothing_else_says_what_is_missed(
    heard, bent, beside
):
    frequency = np.array([6000.0 if heard else np.nan, np.nan])
    cuts = trials(SLOW[:2], np.array([1e-3, 2e-3]), outcome=np.array([2, 0], np.int8), chatter_frequency=frequency)
    fitted = base_of(campaign(tip_machine(), trials=cuts))
    damping = [p.name for p in fitted.fit.parameters].index("damping")
    estimate = fitted.fit.estimate.copy()
    estimate[damping] = 0.3
    base = replace(fitted, fit=replace(fitted.fit, estimate=estimate))
    found = look(base.comparison, [PITCH], replace(ground(base), bent=bent)).starts
    assert {start[damping] for _, start in found} == ({0.3, 0.0} if beside else {0.3})


def test_what_is_named_is_climbed_to_from_its_other_shapes():
    """All phases but the one that it stands at; of a frequency chatter tells, and a strength alone has no shape."""
    plan = campaign(tip_machine(), trials=trials(SLOW[:8], np.full(8, 1e-3)))
    for new, expected in ((candidate("tool_runout"), {-72.0, -36.0, 36.0, 72.0}), (ALONG, set()), (PITCH, set())):
        comparison = extended(Comparison(model=base_model(plan)), [new])
        names, values = [p.name for p in comparison.parameters], np.array([p.null for p in comparison.parameters])
        values[names.index(new.amplitudes[0].name)] = 1e-4
        shape = names.index(new.shapes[0]) if new.shapes else 0
        values[shape] = 10.0
        found = other_shapes(comparison, values, new)
        assert {one[shape] for one in found} == expected
        assert all(np.array_equal(np.delete(one, shape), np.delete(values, shape)) for one in found)


def test_pitches_lie_farther_apart_where_chatter_leaves_fewer_waves():
    scan = VariablePitch.scan
    # Half as many waves make half as much of one of the same pitch; more than are told of, or none known: as they are.
    assert scan.with_waves(0.5 * WAVES) == tuple(2.0 * one for one in LOOKED_AT if 2.0 * one <= LOOKED_AT[-1])
    assert scan.with_waves(2.0 * WAVES) == scan.with_waves(np.inf) == LOOKED_AT
    assert replace(scan, waves=None).with_waves(1.0) == LOOKED_AT
    # Of values to both sides none goes beyond the outermost, and one is left however few waves there are.
    of_two_sides = Scan(parameter="lag", values=(-0.3, -0.1, 0.1, 0.3), waves=10.0)
    assert of_two_sides.with_waves(5.0) == (-0.2, 0.2)
    assert scan.with_waves(0.1) == (LOOKED_AT[-1],)


def test_of_scanned_pitches_the_best_without_the_motion_is_climbed_from_besides_if_it_promises_more_than_all():
    """The two best with the motion stay: a place may hide the right pitches, or be none without it."""
    comparison = extended(Comparison(model=base_model(campaign(tip_machine()))), [PITCH])
    place = [p.name for p in comparison.parameters].index(PITCH.scan[0])

    def at(value, promise):
        start = np.array([p.null for p in comparison.parameters])
        start[place] = value
        return promise, start

    def climbed(*still):
        found = chosen(comparison, PITCH, promised, still)
        return [(promise, start[place]) for promise, start in found]

    promised = [at(0.05, 1.0), at(0.1, -2.0), at(0.2, 15.0), at(0.3, -np.inf), at(0.4, 14.0)]
    best = [(15.0, 0.2), (14.0, 0.4)]
    assert climbed() == climbed(at(0.05, 14.5)) == climbed(at(0.2, 20.0)) == best
    assert climbed(at(0.05, 22.0)) == climbed(at(0.05, 22.0), at(0.3, 21.0)) == [*best, (22.0, 0.05)]


def test_all_shapes_are_looked_at_that_are_not_scanned_with_a_strength(reference_machine):
    """A rear seat may give more than the front one, and less, by any loss that is scanned."""
    seats = candidate("directional_asymmetry", 2)
    base = base_of(campaign(reference_machine, trials=trials(FAST[:2], np.array([1e-3, 2e-3]))))
    found = look(base.comparison, [seats], ground(base)).starts
    place = [p.name for p in extended(base.comparison, [seats]).parameters].index(
        "directional_asymmetry.rear_difference"
    )
    assert {round(start[place], 9) for _, start in found} == {-1.2, -0.6, 0.0, 0.6, 1.2}


def test_waves_between_teeth_are_those_of_most_cuts_that_were_heard():
    speed = 1000.0 * RPM * np.ones(11)
    # Two teeth pass 2000 / 60 times a second: one to eleven waves.
    heard = 2.0 * speed * np.arange(1.0, 12.0)
    silent = campaign(tip_machine(), trials=trials(speed, np.full(11, 1e-3)))
    assert waves_between_teeth(silent) == np.inf
    cuts = trials(speed, np.full(11, 1e-3), chatter_frequency=heard)
    assert waves_between_teeth(campaign(tip_machine(), trials=cuts)) == pytest.approx(10.0)


def test_what_chatter_frequencies_alone_promise_is_climbed_to():
    """Cuts so deep that all chatter: their labels say nothing of the width of the cut, their frequencies do."""
    new = candidate("radial_immersion_error")
    plan = campaign(tip_machine(), trials=trials(np.linspace(5000.0, 16000.0, 40) * RPM, np.full(40, 20e-3)))
    model = base_model(plan, (new.term,))
    truth = model.nulls
    truth[[p.name for p in model.parameters].index(new.amplitudes[0].name)] = 0.1
    base = base_of(measured(plan, truth, np.random.default_rng(3), (new.term,)))
    found = fit_hypothesis(base.comparison, [new], ground(base))
    ended = maximise(found.comparison, [truth], free_parameters(found.comparison, (), truth), 1, LEFT_GAIN)
    assert found.moved
    # A climb with one Jacobian ends where its next step promises half a nat, and the posterior is rough by one.
    assert found.fit.log_posterior > ended.log_posterior - 2.0


def test_a_weak_mode_is_climbed_to_where_slight_strengths_alone_are_looked_at():
    """As beside an effect that suffices: no start is stronger than the first strength then."""
    base = base_of(judged(ACROSS, FAST[::2], {"compliance_um_n": 0.03, "natural_frequency_hz": 960.0}))
    found = pursue(look(base.comparison, [ACROSS], ground(base), SLIGHT_AMPLITUDES))
    assert found.moved
    assert found.fit.log_posterior > base.fit.log_posterior + SMALLEST_PROMISE


def test_a_mode_that_is_stronger_than_any_slight_one_would_tell_is_found_where_cuts_are_slow():
    """Cuts of 1500 to 4000 rpm object to no slight mode anywhere; of a strong one they tell where it is."""
    speed, depth = np.meshgrid(np.linspace(1500.0, 4000.0, 16) * RPM, np.geomspace(5e-4, 8e-3, 6), indexing="ij")
    plan = campaign(tip_machine(), trials=trials(speed.ravel(), depth.ravel()))
    model = base_model(plan, (ALONG.term,))
    true = {"compliance_um_n": 0.3, "natural_frequency_hz": 350.0, "damping_ratio": 0.012}
    truth = np.array([true.get(p.name.split(".")[-1], p.null) for p in model.parameters])
    base = base_of(measured(plan, truth, np.random.default_rng(3), (ALONG.term,)))
    found = fit_hypothesis(base.comparison, [ALONG], ground(base))
    frequency = [p.name for p in found.fit.parameters].index("workpiece_mode.natural_frequency_hz")
    # More than names an effect, and nearer than the next value that is looked at.
    assert found.fit.log_posterior > base.fit.log_posterior + 9.0
    assert found.fit.estimate[frequency] == pytest.approx(350.0, rel=0.03)
