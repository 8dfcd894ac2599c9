"""Identified modes against receptances in closed form, a beam's own, and the statistics of known noise.

The closed form is that of a damped oscillator by its mass, 1/(m (w_n^2 - w^2 + 2 i zeta w_n w)), in
any textbook; the beam's receptance is solved from its matrices, without modes.
"""

import numpy as np
import pytest
from scipy import stats

from chatter_core.chain import structure
from chatter_core.evidence.identify import FLOOR_ERROR, RELATIVE_ERROR, identify_modes
from chatter_core.evidence.modal_fit import library_poles
from chatter_core.spindle import assemble, direct_receptance

HERTZ = 2.0 * np.pi
#: Frequency [Hz], damping ratio, stiffness [N/m] of three modes well apart.
THREE = np.array([[640.0, 0.021, 4.1e7], [1480.0, 0.034, 1.3e7], [2350.0, 0.045, 6.5e6]])


def oscillators(frequency: np.ndarray, modes: np.ndarray) -> np.ndarray:
    """Return the sum of receptances of (frequency [Hz], ratio, stiffness) at (line,) [rad/s]."""
    natural, ratio, stiffness = np.asarray(modes).T
    mass = stiffness / (HERTZ * natural) ** 2
    w = frequency[:, None]
    return (1.0 / (mass * ((HERTZ * natural) ** 2 - w**2 + 2j * ratio * HERTZ * natural * w))).sum(axis=1)


def noisy(receptance: np.ndarray, random: np.random.Generator, share: float = 1.0) -> np.ndarray:
    """Add errors of the model that the identification expects, or a share of them."""
    size = np.abs(receptance)
    deviation = share * np.sqrt((RELATIVE_ERROR * size) ** 2 + (FLOOR_ERROR * size.max()) ** 2)
    real, imaginary = random.standard_normal((2, len(receptance)))
    return receptance + deviation * (real + 1j * imaginary) / np.sqrt(2.0)


def close_to(found, modes, tolerance):
    natural, ratio, stiffness = np.asarray(modes).T
    assert found.natural_frequency / HERTZ == pytest.approx(natural, rel=tolerance)
    assert found.damping_ratio == pytest.approx(ratio, rel=tolerance)
    assert found.modal_stiffness == pytest.approx(stiffness, rel=tolerance)


LINES = HERTZ * np.arange(100.0, 3000.1, 5.0)
UNEVEN = HERTZ * np.cumsum(np.concatenate([[100.0], np.random.default_rng(3).uniform(1.0, 9.0, 500)]))


@pytest.mark.parametrize(
    ("frequency", "modes"),
    [
        pytest.param(LINES, THREE, id="three modes"),
        pytest.param(LINES, THREE[:1], id="one mode"),
        pytest.param(LINES[::8], THREE, id="few lines"),
        pytest.param(UNEVEN, THREE, id="unevenly spaced lines"),
        pytest.param(LINES, [[1000.0, 0.03, 1e7], [1030.0, 0.03, 2e7]], id="half a bandwidth apart"),
        pytest.param(LINES, [[900.0, 0.3, 1e7], [1900.0, 0.5, 2e7]], id="heavily damped"),
        pytest.param(LINES, [[400.0, 0.002, 3e7], [2000.0, 0.2, 5e6]], id="sharp beside broad"),
    ],
)
def test_modes_without_noise_are_exact(frequency, modes):
    found = identify_modes(frequency, oscillators(frequency, modes), mode_count=len(modes))
    # Rounding of the receptance alone, in the least squares' normal directions.
    close_to(found, modes, 1e-8)
    assert found.misfit < 1e-8


def test_what_modes_outside_the_band_leave_is_exact_where_it_has_the_assumed_form():
    above, mass_below = 3.0e-9, 12.0
    receptance = oscillators(LINES, THREE) + above - 1.0 / (mass_below * LINES**2)
    found = identify_modes(LINES, receptance, mode_count=3)
    close_to(found, THREE, 1e-8)
    assert found.compliance_above == pytest.approx(above, rel=1e-7)
    assert found.inverse_mass_below == pytest.approx(1.0 / mass_below, rel=1e-6)


def test_the_number_of_modes_is_found_without_noise():
    found = identify_modes(LINES, oscillators(LINES, THREE))
    assert len(found) == 3
    close_to(found, THREE, 1e-8)


def test_modes_outside_the_band_are_told_by_their_residuals():
    outside = [[25.0, 0.02, 2e5], [20000.0, 0.04, 2e7]]
    band = HERTZ * np.arange(300.0, 3000.1, 5.0)
    found = identify_modes(band, oscillators(band, [*THREE, *outside]))
    # Six times above the band a mode varies by r^2 = 2 % over it, twelve times below one by 0.7 %: of
    # residuals that are a tenth and less of the modes' peaks.
    close_to(found, THREE, 2e-3)
    assert found.compliance_above == pytest.approx(1.0 / 2e7, rel=0.02)
    # The mass line of the mode below: k / w^2.
    assert 1.0 / found.inverse_mass_below == pytest.approx(2e5 / (HERTZ * 25.0) ** 2, rel=0.05)


def test_a_phase_error_of_the_measuring_chain_is_found():
    turned = np.exp(0.04j) * oscillators(LINES, THREE)
    found = identify_modes(LINES, turned, mode_count=3)
    # It is expected to be small, 0.05 rad, and known from these lines to 0.0035: that pulls it by (0.0035/0.05)^2.
    assert found.phase == pytest.approx(0.04, rel=6e-3)
    close_to(found, THREE, 5e-4)


def test_modes_of_a_beam_are_found_in_its_direct_receptance(reference_machine):
    speed = np.array([12000.0]) * HERTZ / 60.0
    built = structure(reference_machine, speed, mode_count=5)
    seats = np.array([built.bearing.radial_stiffness[0] * seat.count for seat in reference_machine.spindle.bearings])
    frequency = HERTZ * np.arange(100.0, 4500.1, 16.0)
    rotor, damping = assemble(reference_machine.spindle), reference_machine.spindle.damping
    receptance = direct_receptance(rotor, damping, seats, frequency)[:, 0, 0]
    found = identify_modes(frequency, receptance)
    known = built.modes
    # Modes above, from 6.4 kHz on, vary by r^2 = half of their compliance over the band: 0.003 of the mean one. The
    # fifth mode, 25 times stiffer than the fourth, bears most of it.
    assert len(found) == 5
    assert found.natural_frequency == pytest.approx(known.natural_frequency[0, :5], rel=1e-3)
    assert found.damping_ratio[:4] == pytest.approx(known.damping_ratio[0, :4], rel=2e-3)
    assert found.modal_stiffness[:4] == pytest.approx(known.modal_stiffness[0, :4], rel=5e-3)
    assert found.modal_stiffness[4] == pytest.approx(known.modal_stiffness[0, 4], rel=0.05)


def test_the_library_finds_the_same_poles_where_there_is_no_noise():
    found = identify_modes(LINES, oscillators(LINES, THREE), mode_count=3)
    poles = library_poles(LINES, oscillators(LINES, THREE))
    for mode in range(3):
        distance = np.abs(poles / np.array([[found.natural_frequency[mode]], [found.damping_ratio[mode]]]) - 1.0)
        # Candidates nearer to each other than this count as one, and the first is kept.
        assert np.any((distance[0] < 2e-3) & (distance[1] < 0.15))


SETS = 100
FEW = HERTZ * np.arange(400.0, 2800.1, 8.0)


@pytest.fixture(scope="module")
def repeated():
    random, true = np.random.default_rng(11), oscillators(FEW, THREE)
    return [identify_modes(FEW, noisy(true, random), mode_count=3) for _ in range(SETS)]


def z_scores(repeated):
    """Return the errors over their stated standard deviations (set, parameter): those of the modes."""
    true = np.concatenate([THREE[:, 0] * HERTZ, THREE[:, 1], THREE[:, 2]])
    errors = [np.concatenate([m.natural_frequency, m.damping_ratio, m.modal_stiffness]) - true for m in repeated]
    return np.array(errors) / np.array([m.deviation[:9] for m in repeated])


@pytest.mark.parametrize("level", [0.68, 0.95])
def test_stated_intervals_cover_the_truth_as_often_as_they_say(repeated, level):
    inside = np.abs(z_scores(repeated)) < stats.norm.ppf(0.5 + 0.5 * level)
    # 99.9 % of binomial counts, for each of nine values by itself.
    low, high = stats.binom.interval(0.999, SETS, level)
    for count in inside.sum(axis=0):
        assert low <= count <= high


def test_estimates_have_no_bias_beside_their_deviation(repeated):
    # The mean of a hundred errors is normal with 1/sqrt(100): 3.3 of it in one of 1000.
    assert np.all(np.abs(z_scores(repeated).mean(axis=0)) < 3.3 / np.sqrt(SETS))


def test_misfit_and_independence_of_expected_errors_are_told(repeated):
    # 602 residuals: their root mean square is one to 1/sqrt(2 x 602) = 3 %; 3.3 of it.
    assert np.all(np.abs(np.array([m.misfit for m in repeated]) - 1.0) < 4.0 * 0.029)
    lines = np.array([m.independent_lines for m in repeated]) / len(FEW)
    assert np.mean(lines) > 0.95


def test_stated_correlation_is_that_of_the_estimates(repeated):
    estimates = np.array([m.modal_stiffness for m in repeated])
    ratios = np.array([m.damping_ratio for m in repeated])
    for mode in range(3):
        observed = np.corrcoef(estimates[:, mode], ratios[:, mode])[0, 1]
        stated = np.mean([m.correlation[3 + mode, 6 + mode] for m in repeated])
        # A correlation from 100 pairs near -0.7 is known to (1 - 0.5)/sqrt(100) = 0.05; 3.3 of it.
        assert observed == pytest.approx(stated, abs=0.165)


def test_close_modes_are_told_apart_in_noise_as_well_as_they_say():
    pair = np.array([[1000.0, 0.02, 1e7], [1060.0, 0.02, 1.5e7]])
    frequency = HERTZ * np.arange(600.0, 1500.1, 2.0)
    found = identify_modes(frequency, noisy(oscillators(frequency, pair), np.random.default_rng(2)))
    assert len(found) == 2
    scores = (
        np.concatenate([found.natural_frequency, found.damping_ratio, found.modal_stiffness])
        - np.concatenate([pair[:, 0] * HERTZ, pair[:, 1], pair[:, 2]])
    ) / found.deviation[:6]
    # Six normal scores stay below 3.5 but for one set of 360.
    assert np.all(np.abs(scores) < 3.5)
