"""Identification: what is refused, how many modes are found, and what a machine gets of them."""

import re

import numpy as np
import pytest
from pydantic import ValidationError
from threadpoolctl import threadpool_info, threadpool_limits

from chatter_core.chain import structure
from chatter_core.errors import InvalidInput
from chatter_core.evidence import modal_fit
from chatter_core.evidence.identified_tip import FREQUENCY_ERROR, GAIN_ERROR, identify_tip
from chatter_core.evidence.identify import FLOOR_ERROR, RELATIVE_ERROR, identify_modes
from chatter_core.evidence.measured import Receptance
from chatter_core.floquet import MethodSettings
from chatter_core.lobes import lobe_block
from chatter_core.machine import Machine, Tip, TipMode
from chatter_core.tip import AXES, TipModes, measured_modes, receptance

HERTZ = 2.0 * np.pi
RPM = HERTZ / 60.0
BAND = HERTZ * np.arange(100.0, 3000.1, 5.0)
#: Frequency [Hz], damping ratio, stiffness [N/m].
TWO = ((700.0, 0.02, 3e7), (1900.0, 0.04, 8e6))


def direct(frequency=BAND, modes=TWO, share=0.25, seed=1):
    """Return the receptance of modes, with a share of the expected errors."""
    natural, ratio, stiffness = np.array(modes).T
    r = frequency[:, None] / (HERTZ * natural)
    true = (1.0 / (stiffness * (1.0 - r**2 + 2j * ratio * r))).sum(axis=1)
    return true + errors_of(true, share, seed)


def errors_of(true, share, seed):
    deviation = share * np.hypot(RELATIVE_ERROR * np.abs(true), FLOOR_ERROR * np.abs(true).max())
    real, imaginary = np.random.default_rng(seed).standard_normal((2, len(true)))
    return deviation * (real + 1j * imaginary) / np.sqrt(2.0)


def measured(axis="x", rpm=0.0, modes=TWO, **settings):
    return taken(direct(modes=modes, **settings), axis, rpm)


def taken(value, axis="x", rpm=0.0, force=None, frequency=BAND):
    return Receptance(
        source="frf.csv",
        spindle_speed=rpm * RPM,
        output_axis=AXES.index(axis),
        input_axis=AXES.index(force or axis),
        frequency=frequency,
        value=value,
    )


def finding(function, *arguments, **settings) -> str:
    with pytest.raises(InvalidInput) as raised:
        function(*arguments, **settings)
    return str(raised.value)


@pytest.mark.parametrize(
    ("frequency", "said"),
    [
        pytest.param(BAND[:12], "found 12 lines, allowed: 20 to 20000", id="too few lines"),
        pytest.param(BAND - BAND[0], "at or below 0 Hz", id="a line at rest"),
        pytest.param(BAND[::-1], "not ascending", id="descending"),
        pytest.param(np.append(BAND[:-1], np.nan), "not finite", id="not a number"),
        pytest.param(BAND[None], "values at", id="two dimensions"),
    ],
)
def test_lines_that_cannot_be_fitted_are_refused(frequency, said):
    values = np.ones(frequency.shape, dtype=complex)
    assert said in finding(identify_modes, frequency, values)


def test_a_receptance_of_zeros_is_refused():
    assert "nothing but zeros" in finding(identify_modes, BAND, np.zeros(len(BAND), dtype=complex))


@pytest.mark.parametrize("turned", [np.conj, np.negative], ids=["time law exp(-i w t)", "sign of the force"])
def test_a_wrong_sign_convention_is_told(turned):
    said = finding(identify_modes, BAND, turned(direct()))
    assert "imaginary part is positive at its peak, 1" in said
    assert "exp(-i w t)" in said


def test_an_acceleration_over_force_is_told():
    assert "acceleration over force" in finding(identify_modes, BAND, -(BAND**2) * direct(share=0.0))


def test_a_cross_receptance_is_told_by_its_negative_stiffness():
    natural = ((700.0, 0.02, -3e7), (1900.0, 0.04, 8e6))
    said = finding(identify_modes, BAND, direct(modes=natural))
    assert "has a negative stiffness" in said
    near = float(re.search(r"a mode near ([0-9.]+) Hz", said)[1])
    assert near == pytest.approx(700.0, rel=0.005)
    assert "two points or two axes" in said


def test_a_band_without_resonance_is_told():
    band = HERTZ * np.arange(100.0, 400.0, 2.0)
    said = finding(identify_modes, band, direct(band, ((4000.0, 0.02, 1e7),)))
    assert "no resonance from 100 Hz to 398 Hz" in said


@pytest.mark.parametrize(
    ("count", "said"),
    [(0, "found 0, allowed: 1 to 12"), (13, "found 13, allowed: 1 to 12")],
)
def test_a_number_of_modes_out_of_range_is_refused(count, said):
    assert said in finding(identify_modes, BAND, direct(), mode_count=count)


def test_more_modes_than_an_exact_receptance_has_are_refused():
    said = finding(identify_modes, BAND, direct(share=0.0), mode_count=5)
    assert "mode_count: found 5, but this receptance tells only 2 modes apart" in said


@pytest.mark.parametrize("seed", range(8))
def test_the_number_of_modes_is_found_in_noise(seed):
    found = identify_modes(BAND, direct(share=1.0, seed=seed))
    assert len(found) == 2
    assert found.natural_frequency / HERTZ == pytest.approx([700.0, 1900.0], rel=0.005)
    assert np.argmin(found.criterion) == 2


def test_a_fit_keeps_to_one_thread_whatever_the_process_has(monkeypatch):
    """Threads wait for one another there: two take seven times as long as one."""
    seen = []

    def noted(*given):
        seen.append({pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"})
        return residual(*given)

    residual = modal_fit._residual
    monkeypatch.setattr(modal_fit, "_residual", noted)
    with threadpool_limits(2):
        before = [pool["num_threads"] for pool in threadpool_info()]
        identify_modes(BAND, direct(), mode_count=2)
        assert [pool["num_threads"] for pool in threadpool_info()] == before
    assert before == [2] * len(before)
    assert seen
    assert all(one == {1} for one in seen)


def test_misfit_says_when_two_modes_do_not_explain_it():
    three = (*TWO, (1300.0, 0.03, 2e7))
    found = identify_modes(BAND, direct(modes=three), mode_count=2)
    assert found.misfit > 2.0
    assert found.independent_lines < 0.5 * len(BAND)
    assert "more than errors explain" in found.statement()
    # The same lines with all modes: deviations are smaller by what was unexplained.
    whole = identify_modes(BAND, direct(modes=three), mode_count=3)
    assert "more than errors explain" not in whole.statement()
    assert found.stiffness_deviation[1] > 3.0 * whole.stiffness_deviation[2]


def test_contributions_and_what_is_outside_add_up_to_the_fit():
    found = identify_modes(BAND, direct())
    # The same sum in another order.
    assert found.contributions.sum(axis=1) + found.outside == pytest.approx(found.fitted, rel=1e-10)


def test_the_machine_gets_what_was_identified_with_gain_and_scale_in_its_deviations():
    found = identify_tip([measured("y", seed=2), measured("x")])
    assert [str(measured) for measured in found.receptances] == ["x over x at 0 rpm", "y over y at 0 rpm"]
    assert [mode.axis for mode in found.tip.modes] == ["x", "x", "y", "y"]
    modes, described = found.modes[0], found.tip.modes[1]
    # Written in the border's units and read back: rounding.
    assert described.natural_frequency == pytest.approx(modes.natural_frequency[1], rel=1e-12)
    assert described.stiffness == pytest.approx(modes.modal_stiffness[1], rel=1e-12)
    assert described.damping_ratio_deviation == modes.damping_deviation[1]
    assert described.stiffness_deviation == pytest.approx(
        np.hypot(modes.stiffness_deviation[1], GAIN_ERROR * modes.modal_stiffness[1]), rel=1e-12
    )
    assert described.natural_frequency_deviation == pytest.approx(
        np.hypot(modes.frequency_deviation[1], FREQUENCY_ERROR * modes.natural_frequency[1]), rel=1e-12
    )


def test_deviations_are_stated_or_left_out():
    mode = {"axis": "x", "natural_frequency_hz": 922.0, "damping_ratio": 0.011, "stiffness_n_um": 1.34}
    assert TipMode.model_validate(mode).described() == mode
    stated = {"natural_frequency_deviation_hz": 2.8, "damping_ratio_deviation": 4e-4, "stiffness_deviation_n_um": 0.05}
    # Keys stand in the order of the class, a deviation behind its value.
    assert TipMode.model_validate({**mode, **stated}).described() == {**mode, **stated}
    tip = [Tip.model_validate({"modes": [{**mode, **extra}]}) for extra in ({}, stated)]
    frequency = np.array([5000.0])
    modes = [measured_modes(each, np.array([0.0])) for each in tip]
    assert np.array_equal(*(receptance(each, frequency) for each in modes))
    with pytest.raises(ValidationError):
        TipMode.model_validate({**mode, "stiffness_deviation_n_um": -0.1})


def test_a_mode_that_one_speed_shows_badly_is_continued_from_another():
    # The middle mode is a 400th of the highest peak at rest, a third of it at speed, and moves meanwhile.
    rest = ((700.0, 0.02, 3e7), (1300.0, 0.03, 4e9), (1900.0, 0.04, 8e6))
    fast = ((650.0, 0.02, 3e7), (1200.0, 0.03, 3e7), (1880.0, 0.04, 8e6))
    assert len(identify_modes(BAND, direct(modes=rest))) == 2
    found = identify_tip([measured(rpm=0.0, modes=rest), measured(rpm=9000.0, modes=fast, seed=3)])
    assert [len(modes) for modes in found.modes] == [3, 3]
    weak = found.modes[0]
    assert weak.stiffness_deviation[1] > 0.2 * weak.modal_stiffness[1]
    known = np.array(rest).T
    assert weak.natural_frequency[[0, 2]] / HERTZ == pytest.approx(known[0, [0, 2]], rel=0.003)
    between = measured_modes(found.tip, np.array([0.0, 4500.0, 9000.0]) * RPM)
    assert between.natural_frequency[1] == pytest.approx(between.natural_frequency[[0, 2]].mean(axis=0), rel=1e-9)


def test_a_mode_without_a_trace_at_another_speed_is_told():
    fast = (*TWO, (1300.0, 0.03, 3e7))
    said = finding(identify_tip, [measured(share=0.0), measured(rpm=9000.0, modes=fast)])
    assert said.startswith(
        "x over x at 0 rpm: receptance: no trace of the mode that a neighbouring speed has at 1300 Hz"
    )


def test_receptances_that_do_not_belong_together_are_refused():
    assert "found none" in finding(identify_tip, [])
    assert "receptance x over x at 0 rpm: found twice" in finding(identify_tip, [measured(), measured()])
    said = finding(identify_tip, [measured(), measured("y"), measured("y", rpm=3000.0)])
    assert "spindle_speed_rpm: 3000 found in one axis alone" in said
    said = finding(identify_tip, [measured(), taken(direct(), "x", force="y")])
    assert "receptance x over y at 0 rpm: its axes differ" in said


def test_refusals_name_axes_and_speed():
    said = finding(identify_tip, [taken(-direct(), "y", rpm=3000.0)])
    assert said.startswith("y over y at 3000 rpm: receptance: its imaginary part")


def test_values_that_no_machine_can_have_are_told():
    # A receptance in um/N taken for one in m/N.
    assert "identified modes[0].stiffness_n_um: found" in finding(identify_tip, [taken(direct() * 1e12)])


def test_the_identified_tip_predicts_the_limit_of_the_spindle_it_was_measured_on(reference_machine):
    speed = np.array([12000.0]) * RPM
    modes: TipModes = structure(reference_machine, speed, mode_count=8).modes
    frequency = HERTZ * np.arange(100.0, 4500.1, 5.0)
    true = receptance(modes, frequency)[0]
    found = identify_tip(
        [
            taken(
                true[:, place, place] + errors_of(true[:, place, place], 1.0, place),
                axis,
                rpm=12000.0,
                frequency=frequency,
            )
            for place, axis in enumerate(AXES)
        ]
    )
    described = reference_machine.described()
    tip = Machine.model_validate(
        {"tip": found.tip.described(), **{key: described[key] for key in ("tool", "cutting", "process")}}
    )
    limits = [
        lobe_block(
            machine,
            spindle_speed=speed,
            axial_depth=np.geomspace(0.2e-3, 5e-3, 12),
            mode_count=count,
            modal_parameters="dynamic",
            method=MethodSettings(name="collocation", tolerance=1e-4),
        ).limit_depth[0, 0]
        for machine, count in ((reference_machine, 8), (tip, len(found.modes[0])))
    ]
    # Depth goes with stiffness and damping ratio of the mode that chatters, each known to half a per cent
    # from lines with the full expected error; 2 % is three deviations of their product, with what modes above add.
    assert limits[1] == pytest.approx(limits[0], rel=0.02)
