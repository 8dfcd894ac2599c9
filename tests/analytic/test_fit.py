"""The fit of problems whose answer is known: linear and normal ones, a logistic one, bounds, jumps, valleys."""

import math
import pickle
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import integrate, optimize, stats

from chatter_core.errors import InvalidInput, NotConverged
from chatter_core.evidence import newton
from chatter_core.evidence.candidates import Hypothesis
from chatter_core.evidence.fit import fit, maximise, result
from chatter_core.evidence.intervals import EDGE_TOLERANCE, HIGHER, HigherPlace, profile_end, profile_interval
from chatter_core.evidence.newton import SMALLEST_GAIN, Climb
from chatter_core.evidence.parameters import Evaluation, Parameter, log_prior, log_share
from chatter_core.evidence.pursuit import LEFT_GAIN
from pipeline.profiling import profiled


def parameter(name="a", **kind):
    return Parameter(name=name, unit="", doc="", **{"prior_width": 1.0, **kind})


class Normal:
    """Residuals of normal data, a function of the values."""

    def __init__(self, parameters, residuals):
        self.parameters, self.residuals = parameters, residuals

    def evaluate(self, values, near=None):
        residual = self.residuals(values)
        density = -0.5 * residual**2 - 0.5 * math.log(2.0 * math.pi)
        return Evaluation(log_density=density, coordinates=residual, score=-residual, datum=np.arange(len(residual)))


def linear(seed=1):
    """Twelve data, linear in three parameters with different priors; their design, data and priors too."""
    rng = np.random.default_rng(seed)
    design, data = rng.standard_normal((12, 3)), rng.standard_normal(12)
    mean, width = np.array([0.0, 0.5, -0.2]), np.array([0.1, 2.0, 0.5])
    parameters = tuple(
        parameter("abc"[i], prior_mean=float(mean[i]), null=float(mean[i]), prior_width=float(width[i]))
        for i in range(3)
    )
    return Normal(parameters, lambda values: data - design @ values), design, data, mean, width


def test_a_linear_normal_problem_has_its_closed_form():
    problem, design, data, mean, width = linear()
    found = fit(problem)
    covariance = np.linalg.inv(design.T @ design + np.diag(width**-2.0))
    estimate = covariance @ (design.T @ data + mean / width**2)
    deviation = np.sqrt(np.diag(covariance))
    # Differences of linear functions are exact; the fit ends within what a step of 0.005 nats is.
    assert found.estimate == pytest.approx(estimate, abs=0.02 * deviation.min())
    assert found.standard_deviation == pytest.approx(deviation, rel=1e-6)
    assert found.correlation == pytest.approx(covariance / np.outer(deviation, deviation), abs=1e-6)
    assert found.pull == pytest.approx((found.estimate - mean) / width, rel=1e-12)
    marginal = stats.multivariate_normal(design @ mean, np.eye(12) + design @ np.diag(width**2) @ design.T)
    assert found.log_evidence == pytest.approx(marginal.logpdf(data), abs=1e-4)
    assert found.converged
    assert not found.at_bound.any()
    assert not found.fixed.any()


def test_fixed_parameters_stay_and_correlate_with_nothing():
    problem, design, data, mean, width = linear()
    found = fit(problem, starts=[np.array([0.0, 1.0, 0.0])], fixed=["b"])
    assert found.estimate[1] == 1.0
    assert found.standard_deviation[1] == 0.0
    assert found.correlation[1].tolist() == [0.0, 1.0, 0.0]
    kept, rest = [0, 2], data - design[:, 1]
    marginal = stats.multivariate_normal(
        design[:, kept] @ mean[kept], np.eye(12) + design[:, kept] @ np.diag(width[kept] ** 2) @ design[:, kept].T
    )
    assert found.log_evidence == pytest.approx(marginal.logpdf(rest), abs=1e-4)


@pytest.mark.parametrize("datum", [-3.0, -0.3, 0.4, 4.0])
def test_an_amplitude_that_cannot_be_negative_has_its_evidence_exactly(datum):
    one = parameter(lower=0.0, prior_width=2.0)
    found = fit(Normal((one,), lambda values: np.array([datum - values[0]])))
    exact, _ = integrate.quad(
        lambda a: stats.norm.pdf(datum - a) * stats.halfnorm.pdf(a, scale=2.0), 0.0, 40.0, points=[5.0], epsabs=1e-14
    )
    assert found.log_evidence == pytest.approx(math.log(exact), abs=1e-3)
    assert found.at_bound[0] == (datum < 0.0)
    assert found.estimate[0] == pytest.approx(max(0.0, 0.8 * datum), abs=0.02)


class Logistic:
    """Labels of a logistic regression: nothing normal about them."""

    def __init__(self, seed=3):
        rng = np.random.default_rng(seed)
        self.design = np.column_stack([np.ones(40), rng.standard_normal(40)])
        self.labels = rng.random(40) < 1.0 / (1.0 + np.exp(-self.design @ [0.5, 1.5]))
        self.parameters = (parameter("a", prior_width=2.0), parameter("b", prior_width=2.0))

    def evaluate(self, values, near=None):
        p = 1.0 / (1.0 + np.exp(-self.design @ values))
        both = np.stack([1.0 - p, p], axis=1)
        density = np.log(np.where(self.labels, p, 1.0 - p))
        seen = np.stack([~self.labels, self.labels], axis=1) / np.sqrt(both)
        return Evaluation(
            log_density=density,
            coordinates=2.0 * np.sqrt(both).ravel(),
            score=seen.ravel(),
            datum=np.repeat(np.arange(40), 2),
        )


def test_labels_are_fitted_to_the_maximum_with_the_curvature_that_is_there():
    problem = Logistic()
    found = fit(problem)

    def height(values):
        return problem.evaluate(values).log_likelihood + log_prior(problem.parameters, values)

    best = optimize.minimize(lambda v: -height(v), np.zeros(2), tol=1e-12)
    weights = (p := 1.0 / (1.0 + np.exp(-problem.design @ best.x))) * (1.0 - p)
    curvature = problem.design.T @ (weights[:, None] * problem.design) + np.eye(2) / 4.0
    assert found.estimate == pytest.approx(best.x, abs=0.1 * found.standard_deviation.min())
    assert found.standard_deviation == pytest.approx(np.sqrt(np.diag(np.linalg.inv(curvature))), rel=0.02)
    exact, _ = integrate.dblquad(lambda b, a: math.exp(height(np.array([a, b]))), -4.0, 6.0, -4.0, 8.0, epsabs=1e-20)
    # Laplace's method: of the order of one over the number of data. The prior's unit is its width.
    assert found.log_evidence == pytest.approx(math.log(exact / 4.0), abs=0.1)


def counted(problem):
    """The problem, and the list to which every evaluation adds its values."""
    asked, evaluate = [], problem.evaluate
    problem.evaluate = lambda values, near=None: (asked.append(values), evaluate(values, near))[1]
    return problem, asked


@pytest.mark.parametrize("kind", ["linear", "logistic", "bent"])
def test_an_approach_comes_near_the_maximum_with_one_jacobian(kind):
    bent = Normal(
        (parameter("a"), parameter("b")), lambda v: np.array([3.0 * (v[1] - v[0] ** 2), 2.0 - v[0], v[1] - 3.0])
    )
    problem, asked = counted({"linear": linear()[0], "logistic": Logistic(), "bent": bent}[kind])
    free = np.ones(len(problem.parameters), dtype=bool)
    start = np.zeros(len(free))
    best = maximise(problem, [start], free)
    climbed = len(asked)
    asked.clear()
    climb = Climb(problem, free)
    near = climb.approach(start, 0.05).values
    # What a step promises is told by a Jacobian that is not that of the place; a climb follows an approach.
    assert climb.posterior(near)[0] == pytest.approx(best.log_posterior, abs=1.0)
    # A climb takes differences by every parameter at every step.
    assert len(asked) < climbed


def test_an_approach_goes_on_with_a_jacobian_that_is_known_and_finds_what_is_missing():
    (problem, asked), free = counted(linear()[0]), np.ones(3, dtype=bool)
    climb, start = Climb(problem, free), np.array([0.05, 0.5, -0.2])
    whole = climb.derivatives(start, problem.evaluate(start), climb.width)[0]
    last = np.array([False, False, True])
    asked.clear()
    near = climb.approach(start, 1e-6, np.where(last, 0.0, whole), last).values
    # The start, one difference, and the two steps that a linear problem may take: the second one tells that it ended.
    assert len(asked) <= 4
    assert near == pytest.approx(maximise(problem, [start], free, smallest_gain=1e-9).values, abs=1e-3)


def test_an_approach_with_a_jacobian_that_lacks_nothing_takes_no_difference():
    problem, asked = counted(linear()[0])
    climb, start = Climb(problem, np.ones(3, dtype=bool)), np.array([0.05, 0.5, -0.2])
    whole = climb.derivatives(start, problem.evaluate(start), climb.width)[0]
    asked.clear()
    near = climb.approach(start, 1e-6, whole).values
    # The start, the step that a linear problem needs, and one that tells that it ended.
    assert len(asked) <= 3
    assert near == pytest.approx(maximise(problem, [start], climb.free, smallest_gain=1e-9).values, abs=1e-3)
    # A Jacobian that was given is not written into.
    assert np.array_equal(whole, climb.derivatives(start, problem.evaluate(start), climb.width)[0])


def test_what_jumps_in_a_step_is_told_and_corrects_nothing():
    jacobian = np.array([[1.0, 0.0], [0.0, 2.0], [1.0, 1.0]])
    jumped = newton._correct(jacobian, np.array([0.5, 10.0, 0.7]), np.array([0.5, 0.0]))
    # The second coordinate was to stay and moved by ten; the third was to move by 0.5, and moved by 0.7.
    assert jumped.tolist() == [False, True, False]
    assert jacobian.tolist() == [[1.0, 0.0], [0.0, 2.0], [pytest.approx(1.4), 1.0]]


def test_a_null_that_the_data_lead_away_from_has_no_more_evidence_than_where_it_stands():
    one = parameter(lower=0.0)
    problem = Normal((one,), lambda values: np.array([3.0 - values[0]]))
    climb = Climb(problem, np.array([True]))
    stayed = result(problem, climb.stay(climb.place(np.zeros(1)), np.array([[-1.0]]), np.array([False])), 0, -np.inf)
    # The gradient of 3 leads inwards: a step would gain 2.25 nats, and nobody took it.
    assert stayed.log_evidence < climb.posterior(np.zeros(1))[0] + math.log(math.sqrt(math.pi))
    assert stayed.reason.endswith("promises 2.2 nats")


def test_a_narrow_bent_valley_is_followed_to_its_end():
    bent = Normal(
        (parameter("a", prior_width=30.0), parameter("b", prior_width=30.0)),
        lambda v: np.array([10.0 * (v[1] - v[0] ** 2), 1.0 - v[0]]),
    )
    found = fit(bent, starts=[np.array([-1.2, 1.0])])
    assert found.converged
    # The prior of width 30 pulls by a thousandth; the fit's end is a tenth of a deviation of one.
    assert found.estimate == pytest.approx([1.0, 1.0], abs=0.25)


def test_a_datum_that_jumps_gives_no_slope_and_does_not_stop_the_fit():
    def residuals(values):
        jumping = 0.0 if values[0] < 0.5001 else 2.0
        return np.array([*(10.0 * (1.0 - values[0]) * np.ones(4)), jumping])

    found = fit(Normal((parameter(),), residuals), starts=[np.array([0.5])])
    assert found.converged
    assert found.estimate[0] == pytest.approx(1.0, abs=0.02)
    assert found.standard_deviation[0] == pytest.approx(1.0 / math.sqrt(401.0), rel=1e-3)


def followed(problem, offset):
    """Return a problem of which what is followed from nearby is another than what is found anew, by (coordinate,)."""
    alone = problem.evaluate

    def evaluate(values, near=None):
        found = alone(values)
        return replace(found, coordinates=found.coordinates + offset * (near is not None))

    problem.evaluate = evaluate
    return problem


@pytest.mark.parametrize("offsets", [(0.3,), (0.3, -0.2), (0.09, 0.09, 0.09), (0.09, -0.09, 0.09), (0.13,)])
@pytest.mark.parametrize("rows", [slice(0, 3), slice(4, 7), slice(9, 12)])
def test_what_is_followed_from_nearby_has_its_slope_though_it_is_another_than_what_is_found_anew(offsets, rows):
    problem, design, _, _, width = linear()
    offset = np.zeros(12)
    offset[rows][: len(offsets)] = offsets
    climb, start, deviation = (
        Climb(followed(problem, offset), np.ones(3, dtype=bool)),
        np.array([0.0, 0.5, -0.2]),
        width,
    )
    true = np.diag(design.T @ design) * width**2 + 1.0
    # As a climb does it: each slope is taken over a share of what the one before has left of deviations.
    for _ in range(newton.MOST_STEPS):
        _, information = climb.slope(start, problem.evaluate(start), deviation)
        deviation = width / np.sqrt(np.diag(information))
    # A change that is no slope is not told from one that is while both together are as large as a slope's may be: what
    # remains of the slope beside it is then a fourth of that at least.
    assert (np.diag(information) < 16.0 * true).all()
    # Where it is told it takes itself away: of differences that are large enough nothing else is left.
    _, information = climb.slope(start, problem.evaluate(start), width * np.array([0.02, 0.02, 0.02]))
    assert np.diag(information) == pytest.approx(true, rel=1e-6)


def test_a_jump_by_one_parameter_takes_no_slope_from_another():
    problem = Normal((parameter("a"), parameter("b")), lambda v: np.array([5.0 * v[1] + 2.0 * (v[0] > 0.300001), v[0]]))
    climb, start = Climb(problem, np.ones(2, dtype=bool)), np.array([0.3, 0.1])
    jacobian, _ = climb.derivatives(start, problem.evaluate(start), climb.width)
    assert jacobian == pytest.approx(np.array([[0.0, 5.0], [1.0, 0.0]]), abs=1e-9)


def test_at_an_upper_bound_differences_are_taken_inwards():
    bounded = Normal(
        (parameter("a", upper=0.5),), lambda v: np.where(v[0] <= 0.5, np.array([3.0 * v[0], v[0] ** 2]), np.nan)
    )
    climb, start = Climb(bounded, np.ones(1, dtype=bool)), np.array([0.5])
    gradient, information = climb.slope(start, bounded.evaluate(start), climb.width)
    # A difference of 0.02 over a square is off by that, and half of it times what the square is.
    assert information[0, 0] == pytest.approx(1.0 + 9.0 + 1.0, abs=0.05)
    assert gradient[0] == pytest.approx(-(4.5 + 0.25) - 0.5, abs=0.006)


def test_a_step_that_falls_is_followed_by_one_that_is_truly_another():
    tried = []

    def residuals(values):
        tried.append(values[0])
        return np.array([10.0 * (1.0 - values[0]), 100.0 * (values[0] > 0.3)])

    climb = Climb(Normal((parameter(),), residuals), np.ones(1, dtype=bool))
    here = climb.place(np.array([0.25]))
    gradient, information = climb.slope(here.values, here.evaluation, climb.width)
    tried.clear()
    found = climb._climb_once(here, gradient, information, climb.free, newton.DAMPING_LEAST, SMALLEST_GAIN, eager=False)
    assert found is not None
    assert 0.25 < found[0].values[0] <= 0.3
    falling = np.array([value - 0.25 for value in tried if value > 0.3])
    # So little damping at first has to be raised a hundred thousandfold before it is felt. From 0.74 to 0.05 it takes
    # no more than log(0.74 / 0.05) / log(1 / 0.7) steps.
    assert (falling[1:] <= (1.0 - newton.OTHERWISE) * falling[:-1]).all()
    assert 2 <= len(falling) <= 8


def test_a_step_that_turns_is_another_though_its_largest_part_stays_as_long():
    """Along (1, 0) and (0, 1) the data say nearly the same; the step to their maximum lowers b, where the edge is."""
    information = 1000.0 * np.array([[1.0, 0.99], [0.99, 1.0]])
    root = np.linalg.cholesky(information).T
    highest = np.array([15.0, -5.0])

    def residuals(values):
        return np.append(root @ (values - highest), 1e4 * (values[1] < 0.0))

    climb = Climb(Normal((parameter("a"), parameter("b")), residuals), np.ones(2, dtype=bool))
    here = climb.place(np.zeros(2))
    found = climb._climb_once(
        here, *climb.slope(here.values, here.evaluation, climb.width), climb.free, 1e-3, 0.1, eager=False
    )
    # Both steps are cut to the longest that may be, by a; only b tells that the one which is taken was not tried.
    assert found is not None
    assert found[0].values[0] == newton.LONGEST_STEP
    assert found[0].values[1] > 0.0


def test_a_climb_goes_on_beyond_an_edge_only_where_it_is_told_to():
    """All steps from 0 fall, the whole one as well, and from where it ends a climb leads higher."""
    one = Normal(
        (parameter(prior_width=20.0),), lambda v: np.array([3.0 * (2.0 - v[0]), 6.0 * (v[0] - 3.0) * (v[0] > 0.05)])
    )
    start, free = np.zeros(1), np.ones(1, dtype=bool)
    stuck, beyond = (maximise(one, [start], free, leaps=leaps) for leaps in (False, True))
    assert (stuck.converged, beyond.converged) == (False, True)
    assert stuck.values[0] <= 0.05
    # 9 (2 - v)^2 + 36 (v - 3)^2 is least at 2.8; the fit ends within 0.005 nats of 45 / 2 (v - 2.8)^2.
    assert beyond.values[0] == pytest.approx(2.8, abs=math.sqrt(0.005 / 22.5))


def test_a_start_without_a_height_is_no_start():
    def residuals(values):
        return np.array([np.nan if values[0] > 5.0 else values[0] - 1.0])

    found = maximise(
        Normal((parameter(prior_width=20.0),), residuals), [np.array([6.0]), np.zeros(1)], np.ones(1, bool), 1
    )
    # Of half a squared distance no more than 0.005 is left, and the prior draws by a four hundredth.
    assert found.values[0] == pytest.approx(1.0, abs=0.1 + 1.0 / 400.0)


def test_of_several_starts_the_best_maximum_is_taken():
    two_peaks = Normal((parameter(prior_width=3.0),), lambda v: np.array([4.0 * (v[0] ** 2 - 1.0), 0.5 * (v[0] - 1.0)]))
    found = fit(two_peaks, starts=[np.array([-1.1]), np.array([1.3])], most=2)
    assert found.estimate[0] == pytest.approx(1.0, abs=0.05)
    alone = fit(two_peaks, starts=[np.array([-1.1])])
    assert alone.estimate[0] < 0.0
    assert alone.log_posterior < found.log_posterior


def test_a_fit_that_is_cut_short_says_so(monkeypatch):
    from chatter_core.evidence import newton

    monkeypatch.setattr(newton, "MOST_STEPS", 1)
    found = fit(Normal((parameter(prior_width=9.0),), lambda v: np.array([20.0 * (v[0] ** 3 - 8.0)])))
    assert not found.converged
    assert found.reason == "no end after 1 steps"


def test_a_fit_that_ends_below_its_start_has_failed():
    problem, *_ = linear()
    free = np.ones(3, dtype=bool)
    best = maximise(problem, [np.zeros(3)], free)
    failed = result(problem, best, 0, started=best.log_posterior + 1.5)
    assert (failed.converged, failed.reason) == (False, "ended 1.5 nats below its start")
    assert result(problem, best, 0, started=best.log_posterior).converged


def test_profile_intervals_of_a_linear_problem_are_normal_quantiles():
    problem, *_ = linear()
    found = fit(problem)
    interval = profile_interval(problem, found, "b", coverage=0.9)
    size = stats.norm.ppf(0.95) * found.standard_deviation[1]
    # Ends are met to two hundredths of a deviation, from an estimate as near to the maximum.
    assert interval.low == pytest.approx(found.estimate[1] - size, abs=0.15 * found.standard_deviation[1])
    assert interval.high == pytest.approx(found.estimate[1] + size, abs=0.15 * found.standard_deviation[1])
    assert not interval.low_is_open
    assert not interval.high_is_open


def test_profile_intervals_are_skew_where_the_posterior_is_and_open_at_a_bound():
    one = parameter(lower=0.0, prior_width=50.0)
    problem = Normal((one,), lambda v: np.array([2.0 - v[0] ** 2]))
    found = fit(problem, starts=[np.array([1.0])])
    interval = profile_interval(problem, found, "a", coverage=0.6826894921370859)
    # v^2 = 2 +- 1, but for the prior's pull and the accuracy of both ends.
    assert (interval.low, interval.high) == (pytest.approx(1.0, abs=0.02), pytest.approx(math.sqrt(3.0), abs=0.02))
    wide = profile_interval(problem, found, "a", coverage=0.999)
    assert (wide.low, wide.low_is_open, wide.high_is_open) == (0.0, True, False)


def test_a_profile_that_climbs_above_its_fit_says_that_the_fit_was_none():
    two_peaks = Normal((parameter(prior_width=3.0),), lambda v: np.array([4.0 * (v[0] ** 2 - 1.0), 0.5 * (v[0] - 9.0)]))
    wrong = fit(two_peaks, starts=[np.array([-1.1])])
    with pytest.raises(NotConverged, match=r"a refit for a ends .* nats above the fit|no end within"):
        profile_interval(two_peaks, wrong, "a", coverage=0.999999)


def stopped(problem, off):
    """A fit that stopped short of its maximum, so many deviations off in its first parameter and its last."""
    found = fit(problem)
    start = found.estimate + off * found.standard_deviation * np.array([1.0, 0.0, 1.0])
    return found, result(problem, maximise(problem, [start], ~found.fixed, 1, smallest_gain=np.inf), 0, -np.inf)


def test_a_profile_says_from_which_place_to_fit_again():
    problem, *_ = linear()
    found, short = stopped(problem, off=2.0)
    with pytest.raises(HigherPlace) as raised:
        profile_end(problem, short, "b", 1)
    # Workers hand it on.
    told = pickle.loads(pickle.dumps(raised.value))
    assert str(told) == str(raised.value)
    assert told.rise > HIGHER
    again = maximise(problem, [told.values], ~found.fixed)
    assert again.log_posterior == pytest.approx(found.log_posterior, abs=SMALLEST_GAIN)


def test_an_end_on_a_rough_posterior_lies_beyond_that_of_a_smooth_one_by_what_the_fit_lacks():
    problem, *_ = linear()
    found, short = stopped(problem, off=1.25)
    lacks = found.log_posterior - short.log_posterior
    # So much higher a refit ends that looks for the end first where it would be of the smooth one.
    assert 0.3 < lacks - 0.5 * stats.norm.ppf(0.95) ** 2 < HIGHER
    end = profile_end(problem, short, "b", 1)
    # The profile is a parabola about the maximum; the drop counts from the fit.
    size = math.sqrt(stats.norm.ppf(0.95) ** 2 + 2.0 * lacks)
    deviation = found.standard_deviation[1]
    assert end.value == pytest.approx(found.estimate[1] + size * deviation, abs=0.15 * deviation)


def leap(edge, rising, beyond):
    """A problem whose residual rises up to an edge, to either side, and is something else beyond it."""

    def residual(v):
        size = np.abs(v)
        return np.where(size < edge, rising(v), np.sign(v) * beyond(size - edge))

    return Normal((parameter(prior_width=20.0),), residual)


def same(v):
    return v


@pytest.mark.parametrize(
    ("problem", "end", "off"),
    [
        # Behind the edge no drop is as small as what is wanted, and the nearest to that is farthest out.
        pytest.param(leap(0.6, same, lambda d: 2.3 - 0.2 * d), 0.6, 1.0, id="sinking"),
        # A plateau whose drop is nearly what is wanted has hardly a slope: the end is taken anywhere on it.
        pytest.param(leap(0.6, same, lambda d: 1.79 + 0.01 * d), 1.05, 7.5, id="plateau"),
        pytest.param(leap(1.6, same, lambda d: 8.0 + d), 1.6, 1.5, id="far"),
        pytest.param(leap(1.6, same, lambda d: 2e3 + d), 1.6, 1.5, id="farther"),
        # A root of twice the drop of 1.645 is where v + 0.3 v^9 is.
        pytest.param(leap(9.0, lambda v: v + 0.3 * v**9, same), 1.0737, 1.5, id="steep"),
    ],
)
def test_ends_are_found_where_the_profile_leaps_lies_flat_or_is_steep(problem, end, off):
    """Within so many times the share of their distance that an edge is known to; a tenth of the drop: 1.5 of these."""
    found = fit(problem)
    assert found.standard_deviation[0] == pytest.approx(1.0, rel=0.01)
    for side in (-1, 1):
        told = profile_end(problem, found, "a", side)
        assert told.value == pytest.approx(side * end, abs=off * EDGE_TOLERANCE * end)
        assert not told.is_open


def test_a_refit_begins_where_the_others_stay_if_that_is_higher():
    """Where a moves, b does not follow as the curvature has it: that leads to a plateau that nothing leads from."""

    def residuals(v):
        follows, plateau = abs(v[0]) < 0.3, abs(v[1]) > 0.5
        return np.array([0.5 * v[0], 3.0 * (v[1] - v[0]) if follows else 3.0 if plateau else 3.0 * v[1]])

    found = fit(Normal((parameter("a", prior_width=90.0), parameter("b", prior_width=90.0)), residuals))
    for side in (-1, 1):
        # a / 2 is then 1.645; a tenth of the drop, and what the priors take off: a thousandth.
        exact = 2.0 * side * stats.norm.ppf(0.95)
        assert profile_end(Normal(found.parameters, residuals), found, "a", side).value == pytest.approx(exact, rel=0.1)


def test_an_end_beside_a_bound_with_a_slope_is_as_near_as_it_is():
    """Of a normal density cut off ten deviations out the end lies a seventh of a deviation from the bound."""
    problem = Normal((parameter(prior_width=20.0, lower=0.0),), lambda v: v + 10.0)
    found = fit(problem)
    assert found.at_bound[0]
    # (v + 10)^2 - 10^2 = 1.645^2, and a tenth of the drop.
    exact = math.sqrt(100.0 + stats.norm.ppf(0.95) ** 2) - 10.0
    assert profile_end(problem, found, "a", 1).value == pytest.approx(exact, rel=0.1)
    assert profile_end(problem, found, "a", -1).is_open


def test_a_hypothesis_is_fitted_again_from_where_a_profile_ends_above_it():
    problem, *_ = linear()
    found, short = stopped(problem, off=2.0)
    effect = SimpleNamespace(name="b", term=SimpleNamespace(parameters=problem.parameters[1:2]))
    named, limits = profiled(None, Hypothesis(candidates=(effect,), comparison=problem, fit=short))
    assert named.fit.log_posterior == pytest.approx(found.log_posterior, abs=LEFT_GAIN)
    (interval,) = limits.values()
    size = stats.norm.ppf(0.95) * found.standard_deviation[1]
    assert interval.method == "profile"
    assert interval.low == pytest.approx(found.estimate[1] - size, abs=0.15 * found.standard_deviation[1])
    assert interval.high == pytest.approx(found.estimate[1] + size, abs=0.15 * found.standard_deviation[1])


def test_a_base_model_has_no_effects_to_profile():
    problem, *_ = linear()
    base = Hypothesis(candidates=(), comparison=problem, fit=fit(problem))
    assert profiled(None, base) == (base, {})


def test_what_cannot_be_fitted_is_told():
    problem, *_ = linear()
    with pytest.raises(InvalidInput, match=r"parameter: found 'd', allowed: a, b, c"):
        fit(problem, fixed=["d"])
    with pytest.raises(InvalidInput, match=r"start: found 2 values, needed one for each of 3 parameters"):
        fit(problem, starts=[np.zeros(2)])
    bounded = Normal((parameter(lower=0.0),), lambda v: v)
    with pytest.raises(InvalidInput, match=r"start of a: found -1 , allowed 0 to inf"):
        fit(bounded, starts=[np.array([-1.0])])
    with pytest.raises(InvalidInput, match=r"its null 0  must lie within its bounds, 1 to 2"):
        parameter(lower=1.0, upper=2.0)
    with pytest.raises(InvalidInput, match=r"prior_width: found 0, allowed: above 0"):
        parameter(prior_width=0.0)
    found = fit(problem, fixed=["a"])
    with pytest.raises(InvalidInput, match=r"parameter a: it was fixed in the fit"):
        profile_interval(problem, found, "a")
    with pytest.raises(InvalidInput, match=r"coverage: found 1, allowed: between 0 and 1"):
        profile_interval(problem, found, "b", coverage=1.0)


def test_priors_are_normal_within_their_bounds():
    both = (parameter("a", prior_width=0.5, prior_mean=1.0, null=1.0), parameter("b", lower=0.0, prior_width=2.0))
    values = np.array([0.7, 1.0])
    expected = stats.norm.logpdf(-0.6) + stats.halfnorm.logpdf(0.5)
    assert log_prior(both, values) == pytest.approx(expected, rel=1e-13)
    assert log_prior(both, np.array([0.7, -1.0])) == -np.inf
    low, high = np.array([-np.inf, -1.0, 30.0, -40.0]), np.array([np.inf, 2.0, 31.0, -39.0])
    # Far tails from the asymptotic series of the survival function, in scipy's own log.
    expected = [
        0.0,
        math.log(stats.norm.cdf(2.0) - stats.norm.cdf(-1.0)),
        stats.norm.logsf(30.0),
        stats.norm.logsf(39.0),
    ]
    assert log_share(low, high) == pytest.approx(expected, rel=1e-11, abs=1e-15)
