"""The machine that hides effects, with nothing hidden, against the program: bearing, receptances, stability.

Two codes that share nothing: what a campaign's ``machine.yaml`` says has to mean the same machine in both. Here
papers are without errors and measurements without noise.
"""

import itertools
import math

import numpy as np
import pytest

from chatter_core import spindle as program_spindle
from chatter_core import tip
from chatter_core.bearing import axisymmetric_state
from chatter_core.chain import structure
from chatter_core.machine import Bearing as ProgramBearing
from chatter_core.machine import Machine as ProgramMachine
from chatter_core.stability import evaluate
from tests.conftest import COLLOCATION
from tests.hidden_effect.ball_bearing import radial_stiffness
from tests.hidden_effect.campaign import cut_all, draw_shop
from tests.hidden_effect.drawing import BEARINGS
from tests.hidden_effect.effects import prepared
from tests.hidden_effect.hidden import Hidden
from tests.hidden_effect.machine import NITRIDE, STEEL, Bearing, described
from tests.hidden_effect.structure import CUT_MODES, RECEPTANCE_MODES, Spindle

RPM = math.pi / 30.0
#: Seeds that hide nothing; up- and down-milling, two and three helical teeth.
SEEDS = (1003, 1009)


@pytest.fixture(scope="module", params=SEEDS)
def shop(request):
    """A shop whose papers are right."""
    drawn = draw_shop(request.param, errors=0.0)
    assert drawn.plan.kind == "none"
    return drawn


@pytest.mark.parametrize(("row", "ball"), list(zip(BEARINGS, itertools.cycle([STEEL, NITRIDE]))))
def test_bearings_are_as_stiff_at_every_speed(row, ball):
    _, pitch, diameter, count, inner, outer, highest = row
    bearing = Bearing(
        pitch_diameter_m=pitch * 1e-3,
        ball_diameter_m=diameter * 1e-3,
        ball_count=count,
        contact_angle_deg=15.0,
        inner_conformity=inner,
        outer_conformity=outer,
        ball=ball,
    )
    keys = {
        "ring": {"youngs_modulus_gpa": 206.0, "poisson_ratio": 0.3, "density_kg_m3": 7800.0},
        "pitch_diameter_mm": pitch,
        "ball_diameter_mm": diameter,
        "ball_count": count,
        "contact_angle_deg": 15.0,
        "inner_groove_conformity": inner,
        "outer_groove_conformity": outer,
    }
    keys["ball"] = {
        "youngs_modulus_gpa": ball.modulus_pa / 1e9,
        "poisson_ratio": ball.poisson,
        "density_kg_m3": ball.density_kg_m3,
    }
    speeds = np.array([0.0, 0.5, 1.0]) * highest * RPM
    state = axisymmetric_state(ProgramBearing.model_validate(keys), 150.0, speeds, "constant")
    found = [radial_stiffness(bearing, speed, 150.0) for speed in speeds]
    # The same equations: roots to 1e-7 of the preload, differences of 2 nm.
    np.testing.assert_allclose(found, state.radial_stiffness, rtol=1e-4)


def test_receptances_agree(shop):
    program = ProgramMachine.model_validate(described(shop.papers))
    frequency = 2.0 * np.pi * np.arange(100.0, 4500.0, 5.0)
    for rpm in (0.0, shop.highest_rpm):
        built = structure(program, np.array([rpm * RPM]), mode_count=20)
        expected = tip.receptance(built.modes, frequency)[0]
        found = Spindle(shop.truth, Hidden()).tip(rpm * RPM, modes=RECEPTANCE_MODES).receptance(frequency)
        # Frequencies of the two beams differ by 1e-4 (the size of the elements here), which a resonance with a damping
        # ratio of 0.02 shows as 1e-4/(2 * 0.02) of itself; modes above 20 kHz are left out here and are worth another
        # 1 %.
        assert np.abs(found - expected).max() < 0.01 * np.abs(expected).max()


def test_gyroscopic_receptances_agree():
    shop = draw_shop(SEEDS[1], errors=0.0)
    papers = prepared(shop.papers, "gyroscopic_coupling", 0.5)
    described_machine = ProgramMachine.model_validate(described(papers)).spindle
    rotor = program_spindle.assemble(described_machine)
    damping = described_machine.damping
    assert damping.kind == "proportional"  # the direct solution has no modal damping
    speed = shop.highest_rpm * RPM
    spindle = Spindle(papers, Hidden(gyroscopic=1.0))
    stiffness = spindle.bearing_stiffness(speed, papers.preload_n) * np.array([seat.count for seat in papers.seats])
    frequency = 2.0 * np.pi * np.arange(100.0, 4500.0, 90.0)
    # Teeth and rotor turn from +y to +x.
    expected = program_spindle.direct_receptance(rotor, damping, stiffness, frequency, spin_speed=-speed)
    found = spindle.tip(speed, modes=RECEPTANCE_MODES).receptance(frequency)
    assert np.abs(expected[:, 0, 1]).max() > 0.03 * np.abs(expected).max()  # there is a coupling to agree on
    # As above.
    assert np.abs(found - expected).max() < 0.01 * np.abs(expected).max()


def test_labels_agree_with_floquet_theory(shop):
    conditions, results = cut_all(shop, np.random.default_rng(0))
    judged = [(c, r.outcome) for c, r in zip(conditions, results, strict=True) if r.outcome != "marginal"]
    program = ProgramMachine.model_validate(described(shop.papers))
    built = structure(program, np.array([c.speed_rpm * RPM for c, _ in judged]), mode_count=CUT_MODES)
    depth = np.array([c.depth_m for c, _ in judged])
    found = evaluate(program, built, np.arange(len(judged)), depth, COLLOCATION, np.full(len(judged), 1.0))
    agree = (found.spectral_radius > 1.0) == np.array([outcome == "chatter" for _, outcome in judged])
    # Cuts within one per cent of the limit may end either way: teeth that enter with a chip thinner than the vibration
    # lose contact, which no linear theory knows. Ladders of depths have 1 to 2 % of their cuts there.
    assert np.mean(agree) >= 0.97
    assert np.abs(found.spectral_radius[~agree] - 1.0).max(initial=0.0) < 0.03
    assert {outcome for _, outcome in judged} == {"stable", "chatter"}
