"""Parts of the machine that hides effects, against closed forms: beam, bearing at rest, cut, surface."""

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from scipy.optimize import brentq

from tests.hidden_effect import beam
from tests.hidden_effect.ball_bearing import Ball, contact_factor, radial_stiffness
from tests.hidden_effect.beam import assemble, shear_coefficient
from tests.hidden_effect.cutting import Cut, simulate
from tests.hidden_effect.judgement import chatter_frequency, not_repeating, outcome
from tests.hidden_effect.machine import NITRIDE, STEEL, Bearing, Section
from tests.hidden_effect.structure import plane_modes

BEARING = Bearing(
    pitch_diameter_m=0.06,
    ball_diameter_m=0.008731,
    ball_count=19,
    contact_angle_deg=15.0,
    inner_conformity=0.57,
    outer_conformity=0.54,
    ball=NITRIDE,
)


def beam_errors(bore):
    """Relative errors of the first four frequencies of a beam on knife edges at both ends."""
    section = Section(part="shaft", length_m=0.5, outer_diameter_m=0.05, inner_diameter_m=bore, material=STEEL)
    shaft = assemble((section,), (0.0, 0.5))
    stiffness = shaft.stiffness.copy()
    stiffness[shaft.seats, shaft.seats] += 1e14
    found = scipy.linalg.eigh(stiffness, shaft.mass, eigvals_only=True, subset_by_index=[0, 3])
    area, second = math.pi / 4.0 * (0.05**2 - bore**2), math.pi / 64.0 * (0.05**4 - bore**4)
    shear = shear_coefficient(0.3, bore / 0.05) * 206e9 / 2.6 * area
    exact = []
    for k in np.arange(1, 5) * math.pi / 0.5:
        # Sine and cosine waves solve both equations of such a beam exactly.
        elastic = [[shear * k**2, -shear * k], [-shear * k, 206e9 * second * k**2 + shear]]
        inertia = np.diag([7800.0 * area, 7800.0 * second])
        exact.append(scipy.linalg.eigh(elastic, inertia, eigvals_only=True)[0])
    return np.sqrt(found / np.array(exact)) - 1.0


@pytest.mark.parametrize("bore", [0.0, 0.02])
def test_a_uniform_beam_on_knife_edges_has_timoshenkos_frequencies(bore, monkeypatch):
    coarse = beam_errors(bore)
    monkeypatch.setattr(beam, "LONGEST_ELEMENT", beam.LONGEST_ELEMENT / 2.0)
    fine = beam_errors(bore)
    assert np.abs(coarse).max() < 1.2e-4  # what elements of 0.4 diameters leave at the fourth frequency
    # Fourth order at least: halving the elements divides the error by sixteen, or by more where 1/0.4 does not go up.
    assert np.all(coarse[2:] / fine[2:] > 15.0)


def test_a_ball_on_a_plane_has_hertz_closed_form():
    # Q = 4/3 E* sqrt(R) delta^1.5 for a sphere; the ellipse is nearly a circle, as the elliptic form cannot be one.
    radius, compliance = 0.01, 1.0 / 115e9
    found = contact_factor(2.0 / radius, 1e-4, compliance)
    # The difference of curvatures of 1e-4 changes the factor by its square.
    assert found == pytest.approx(4.0 / 3.0 * math.sqrt(radius) / compliance, rel=1e-6)


def test_the_bearing_at_rest_is_a_ring_of_contacts_in_series():
    ball, preload = Ball(BEARING), 150.0
    series = (ball.inner_factor ** (-2.0 / 3.0) + ball.outer_factor ** (-2.0 / 3.0)) ** -1.5
    radial = ball.groove_distance * math.cos(ball.angle)

    def load(angle):
        return series * (radial / math.cos(angle) - ball.groove_distance) ** 1.5

    angle = brentq(lambda at: 19 * load(at) * math.sin(at) - preload, ball.angle + 1e-9, ball.angle + 0.3, xtol=1e-14)
    length = radial / math.cos(angle)
    along = 1.5 * load(angle) / (length - ball.groove_distance)
    exact = 19 / 2.0 * (along * math.cos(angle) ** 2 + load(angle) / length * math.sin(angle) ** 2)
    # Central differences of 2 nm on approaches of some um.
    assert radial_stiffness(BEARING, 0.0, preload) == pytest.approx(exact, rel=1e-5)


def impact_cut(depth, **changed):
    """One straight tooth that cuts for two degrees about +x, where only x matters; see ``impact_radius``."""
    cut = Cut(
        speed=2.0 * math.pi / 0.004,
        depth=depth,
        steps=720,
        teeth=np.array([0]),
        radius=np.zeros(1),
        entry=math.pi / 2.0 - 0.0175,
        exit=math.pi / 2.0 + 0.0175,
        feed_per_revolution=1e-3,
        tangential=0.0,
        radial=5e8,
        lag=0.0,
        cutting_speed=10.0,
        slices=1,
        stock=math.inf,
    )
    return replace(cut, **changed)


FREQUENCY, DAMPING, MASS = 2.0 * math.pi * 410.0, 0.01, 0.05
TIP = plane_modes(np.array([FREQUENCY]), np.array([DAMPING]), np.array([MASS**-0.5]), 0)


def impact_radius(depth):
    """Spectral radius of the map of very short cuts: free flight, then v jumps by -(k b d/m)(x - x before).

    B. Davies, J. Pratt, B. Dutterer, T. Burns, J. Manuf. Sci. Eng. 124 (2002) 217-225, have this limit of milling.
    """
    period = 0.004
    damped, decay = FREQUENCY * math.sqrt(1.0 - DAMPING**2), math.exp(-DAMPING * FREQUENCY * period)
    c, s, r = math.cos(damped * period), math.sin(damped * period), DAMPING / math.sqrt(1.0 - DAMPING**2)
    flight = decay * np.array([[c + r * s, s / damped], [-s * FREQUENCY**2 / damped, c - r * s]])
    jump = 5e8 * depth * (0.035 / (2.0 * math.pi) * period) / MASS
    whole = np.zeros((3, 3))
    whole[:2, :2] = flight
    whole[1] -= jump * np.array([*flight[0], -1.0])
    whole[2, 0] = 1.0
    # State (x, v, x before): the new x is the first row's, what it was before the third's.
    whole[1, 2], whole[1, 0] = 0.0, whole[1, 0] + jump
    return float(np.abs(np.linalg.eigvals(whole)).max())


@pytest.mark.parametrize("share", [0.8, 1.2])
def test_short_cuts_grow_and_decay_as_the_map_of_impacts(share):
    limit = brentq(lambda depth: impact_radius(depth) - 1.0, 1e-4, 5e-2)
    depth, revolutions = share * limit, 60
    motion, _ = simulate(impact_cut(depth), TIP, revolutions=revolutions, observed=revolutions, settled=0.0)
    # What changes from one revolution to the next has no part that repeats.
    change = np.diff(motion.reshape(revolutions, -1, 2)[:, :, 0], axis=0)
    size = np.sqrt((change**2).mean(axis=1))
    slope = np.polyfit(np.arange(20, revolutions - 1), np.log(size[20:]), 1)[0]
    # The cut lasts 0.06 of a wave's radian: the impact's error is of that order in the rate, which is small itself.
    assert slope == pytest.approx(math.log(impact_radius(depth)), abs=0.004)
    assert (slope > 0.0) == (share > 1.0)


def test_between_cuts_the_tip_swings_freely():
    motion, times = simulate(impact_cut(1e-3), TIP, revolutions=3, observed=3, settled=0.0)
    # The cut lies at step 180 of 720; from there to the next one, a little apart.
    x = motion[720 + 200 : 1440 + 170, 0]
    damped = FREQUENCY * math.sqrt(1.0 - DAMPING**2)
    decay = math.exp(-DAMPING * FREQUENCY * times[0])
    expected = 2.0 * decay * math.cos(damped * times[0]) * x[1:-1] - decay**2 * x[:-2]
    # Exact but for rounding.
    np.testing.assert_allclose(x[2:], expected, atol=1e-9 * np.abs(x).max())


def test_a_tooth_that_stands_back_too_far_never_cuts():
    # Two teeth, the second back by more than the feed per revolution: the same as one tooth alone.
    stiff = plane_modes(np.array([2.0 * math.pi * 4000.0]), np.array([0.05]), np.array([10.0**-0.5]), 0)
    wide = {"entry": 0.3, "exit": 2.5, "tangential": 1e9, "depth": 1e-4}
    one, _ = simulate(impact_cut(**wide), stiff, revolutions=5, observed=5, settled=0.0)
    two_teeth = {"teeth": np.array([0, 360]), "radius": np.array([0.0, -1.2e-3])}
    two, _ = simulate(impact_cut(**wide, **two_teeth), stiff, revolutions=5, observed=5, settled=0.0)
    np.testing.assert_array_equal(one, two)


def test_teeth_that_lose_contact_keep_chatter_finite():
    limit = brentq(lambda depth: impact_radius(depth) - 1.0, 1e-4, 5e-2)
    motion, _ = simulate(impact_cut(3.0 * limit), TIP, revolutions=400, observed=100, settled=0.0)
    rest = not_repeating(motion, 720)
    # Linear growth would be by ten powers of ten; a tooth out of the cut cannot push.
    assert 0.1e-3 < np.abs(rest).max() < 20e-3
    assert outcome(motion, 720, 1e-3) == "chatter"


def test_the_strongest_line_is_found_between_the_lines():
    step_time, period = 1e-5, 250
    time = np.arange(16000) * step_time
    forced, chatter = 5e-5 * np.sin(2.0 * np.pi * 800.0 * time), 1e-5 * np.sin(2.0 * np.pi * 1234.5 * time)
    motion = np.column_stack([forced + chatter, 0.3 * forced])
    # Lines lie 6 Hz apart; the parabola through the logarithms of a Hann line errs by a twentieth of that.
    assert chatter_frequency(motion, period, step_time) == pytest.approx(1234.5, abs=0.5)
    assert outcome(motion, period, 1e-4) == "marginal"
    assert outcome(np.column_stack([forced, forced]), period, 1e-4) == "stable"
