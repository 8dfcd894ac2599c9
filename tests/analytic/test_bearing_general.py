"""General bearing load against closed forms and limits.

- Pure thrust: the axisymmetric state, which is solved by other equations.
- Pure radial load without clearance: R. Stribeck's sum, the most loaded ball carries F_r / sum cos^2.5,
  which is 4.37 F_r / Z for many balls (Harris and Kotzalas, Essential Concepts, 2007, chapter 7).
- Load zone with clearance: balls within cos(psi) > P_d / (2 d_r) touch (same source).
- No load at speed: the balls rest on the outer race, held there by centrifugal force alone.
- Ceramic balls: contact factor and centrifugal force change as modulus and density say.
"""

import math

import numpy as np
import pytest

from chatter_core.bearing import axisymmetric_state
from chatter_core.bearing.arrangement import back_to_back, face_to_face, loaded_arrangement, tandem
from chatter_core.bearing.ball import ball_of
from chatter_core.bearing.general import displaced_bearing, loaded_bearing
from chatter_core.errors import InvalidInput, NoEquilibrium
from chatter_core.machine import Bearing

RPM = 2.0 * math.pi / 60.0
STEEL = {"youngs_modulus_gpa": 206.0, "poisson_ratio": 0.3, "density_kg_m3": 7800.0}
CERAMIC = {"youngs_modulus_gpa": 310.0, "poisson_ratio": 0.27, "density_kg_m3": 3200.0}


def bearing(**changes) -> Bearing:
    described = {
        "pitch_diameter_mm": 60.0,
        "ball_diameter_mm": 8.731,
        "ball_count": 19,
        "contact_angle_deg": 15.0,
        "inner_groove_conformity": 0.57,
        "outer_groove_conformity": 0.54,
        "ball": STEEL,
        "ring": STEEL,
    } | changes
    return Bearing.model_validate({key: value for key, value in described.items() if value is not None})


def radial_bearing(clearance_um: float, **changes) -> Bearing:
    return bearing(contact_angle_deg=None, radial_clearance_um=clearance_um, **changes)


@pytest.mark.parametrize("control", ["outer", "inner", "hybrid"])
@pytest.mark.parametrize("rpm", [0.0, 12000.0, 30000.0])
def test_pure_thrust_is_the_axisymmetric_state(rpm, control):
    one = bearing(raceway_control=control)
    expected = axisymmetric_state(one, 200.0, np.array([rpm * RPM]), "constant")
    found = loaded_bearing(one, (200.0, 0.0, 0.0), rpm * RPM)
    # Two solvers of the same state, each to 1e-9 of the load or better.
    assert found.displacement[0] == pytest.approx(expected.axial_displacement[0], rel=1e-7)
    assert found.stiffness[0, 0] == pytest.approx(expected.axial_stiffness[0], rel=1e-7)
    assert found.stiffness[1, 1] == pytest.approx(expected.radial_stiffness[0], rel=1e-7)
    for name in ("inner_contact_angle", "outer_contact_angle", "inner_contact_force", "outer_contact_force"):
        assert getattr(found, name) == pytest.approx(np.full(19, getattr(expected, name)[0]), rel=1e-7)


@pytest.mark.parametrize("count", [8, 15, 60])
def test_pure_radial_load_is_stribecks_sum(count):
    load = 100.0 * count
    one = radial_bearing(0.0, ball_count=count, pitch_diameter_mm=300.0)
    found = loaded_bearing(one, (0.0, load, 0.0))
    cosine = np.maximum(0.0, np.cos(found.azimuth))
    expected = load / np.sum(cosine**2.5) * cosine**1.5
    # The ring's equilibrium is met to 1e-9 of the load.
    assert found.inner_contact_force == pytest.approx(expected, rel=1e-7, abs=1e-6)
    assert found.displacement[[0, 2]] == pytest.approx([0.0, 0.0], abs=1e-15)
    if count == 60:
        assert found.inner_contact_force.max() == pytest.approx(4.37 * load / count, rel=2e-3)  # its three digits


def test_clearance_bounds_the_load_zone():
    clearance = 20e-6
    one = radial_bearing(clearance * 1e6, ball_count=21)
    found = loaded_bearing(one, (0.0, 500.0, 0.0))
    touching = np.cos(found.azimuth) > clearance / 2.0 / found.displacement[1]
    assert np.array_equal(found.in_load_zone, touching)
    assert 3 <= touching.sum() < 11
    # Without axial load the grooves face each other.
    assert found.inner_contact_angle[touching] == pytest.approx(np.zeros(touching.sum()), abs=1e-7)


def test_clearance_and_the_contact_angle_that_it_leaves_are_the_same_bearing():
    angle = math.radians(15.0)
    distance = (0.57 + 0.54 - 1.0) * 8.731e-3
    with_clearance = radial_bearing(2e6 * distance * (1.0 - math.cos(angle)))
    # The angle comes back through acos(1 - small): a few digits are lost on the way.
    assert with_clearance.unloaded_contact_angle == pytest.approx(angle, rel=1e-12)
    found, expected = (loaded_bearing(b, (300.0, 100.0, 0.5)) for b in (with_clearance, bearing()))
    assert found.stiffness == pytest.approx(expected.stiffness, rel=1e-7, abs=1e-3)


def test_balls_pressed_in_carry_load_all_around():
    found = loaded_bearing(radial_bearing(-10.0), (0.0, 50.0, 0.0))
    assert found.in_load_zone.all()
    # In the plane of the grooves every ball is compressed by half the interference and a part of d_r.
    squeeze = 5e-6 + found.displacement[1] * np.cos(found.azimuth)
    expected = ball_of(radial_bearing(-10.0)).series_factor * squeeze**1.5
    assert found.inner_contact_force == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("control", ["outer", "inner", "hybrid"])
def test_without_load_centrifugal_force_presses_the_balls_outwards(control):
    speed = 15000.0 * RPM
    one = bearing(raceway_control=control)
    # Locked where balls and rings just touch, the balls would wedge between them; facing each other
    # the grooves leave the balls to the outer race.
    facing = -(0.57 + 0.54 - 1.0) * 8.731e-3 * math.sin(math.radians(15.0))
    found = displaced_bearing(one, (facing, 0.0, 0.0), speed)
    assert not found.in_load_zone.any()
    # The inner ring feels nothing, whichever race controls.
    assert found.load == pytest.approx(np.zeros(3), abs=1e-9)
    assert found.centrifugal_force.min() > 1.0
    if control == "outer":
        assert found.outer_contact_force == pytest.approx(found.centrifugal_force, rel=1e-9)
        assert found.outer_contact_angle == pytest.approx(np.zeros(19), abs=1e-9)


def test_contact_angle_grows_where_an_angular_bearing_is_pushed_and_falls_where_it_is_squeezed():
    pushed = loaded_bearing(bearing(), (400.0, 0.0, 3.0))
    assert np.degrees(pushed.inner_contact_angle)[np.argmax(pushed.inner_contact_force)] > 16.0
    # A radial displacement presses the balls on its side flat and opens the angle on the other.
    squeezed = displaced_bearing(bearing(), (0.0, 20e-6, 0.0))
    angle = np.degrees(squeezed.inner_contact_angle)
    assert angle[0] < 15.0 < angle[10]
    assert squeezed.in_load_zone[0]
    assert not squeezed.in_load_zone[10]


def test_a_lost_ball_is_no_part_of_the_load():
    """At speed the load is the sum over touching balls, friction included."""
    for control in ("outer", "hybrid"):
        found = displaced_bearing(bearing(raceway_control=control), (-25e-6, 25e-6, 0.0), 12000.0 * RPM)
        touching = found.in_load_zone
        assert 0 < touching.sum() < 19
        share = {"outer": 0.0}.get(control)
        force = found.inner_contact_force
        if share is None:
            share = 2.0 * force / (force + found.outer_contact_force)
        held = share * found.gyroscopic_moment / 8.731e-3
        axial = force * np.sin(found.inner_contact_angle) - held * np.cos(found.inner_contact_angle)
        assert found.load[0] == pytest.approx(np.sum(axial[touching]), rel=1e-9)


@pytest.mark.parametrize("clearance", [0.0, 1.0, 20.0, -5.0])
@pytest.mark.parametrize("rpm", [3000.0, 20000.0])
def test_radial_bearings_carry_thrust_at_speed(rpm, clearance):
    one = radial_bearing(clearance, ball_count=12, inner_groove_conformity=0.52, outer_groove_conformity=0.53)
    expected = axisymmetric_state(one, 200.0, np.array([rpm * RPM]), "constant")
    found = loaded_bearing(one, (200.0, 0.0, 0.0), rpm * RPM)
    assert found.displacement[0] == pytest.approx(expected.axial_displacement[0], rel=1e-6)
    tilted = loaded_bearing(one, (200.0, 60.0, 0.0), rpm * RPM)
    assert tilted.load == pytest.approx([200.0, 60.0, 0.0], abs=1e-6)


def test_ceramic_balls_follow_modulus_and_density():
    steel, ceramic = bearing(), bearing(ball=CERAMIC)

    def modulus(ball):
        return 1.0 / ((1.0 - ball["poisson_ratio"] ** 2) / ball["youngs_modulus_gpa"] + (1.0 - 0.3**2) / 206.0)

    ratio = ball_of(ceramic).inner_factor / ball_of(steel).inner_factor
    assert ratio == pytest.approx(modulus(CERAMIC) / modulus(STEEL), rel=1e-12)  # Hertz: K is proportional to E'
    load, speed = (200.0, 60.0, 0.0), 18000.0 * RPM
    heavy, light = (loaded_bearing(b, load, speed) for b in (steel, ceramic))
    # Angles differ a little, and the orbit speed with them: forces are in the ratio of densities to 10 %.
    assert light.centrifugal_force.mean() / heavy.centrifugal_force.mean() == pytest.approx(3200 / 7800, rel=0.1)
    resting = [loaded_bearing(b, load).stiffness[1, 1] for b in (steel, ceramic)]
    assert light.stiffness[1, 1] / resting[1] > heavy.stiffness[1, 1] / resting[0]


def test_tandem_bearings_share_a_thrust():
    found = loaded_arrangement(tandem(bearing(), 0.016, 3), (600.0, 0.0, 0.0))
    for one in found.bearings:
        assert one.load[0] == pytest.approx(200.0, rel=1e-8)
    # In tilt they stand apart: each adds its own tilt stiffness, its couplings, and K_rr times its place squared.
    alone = loaded_bearing(bearing(), (200.0, 0.0, 0.0)).stiffness
    expected = 3.0 * alone[2, 2] + 2.0 * 0.016**2 * alone[1, 1]
    assert found.stiffness[2, 2] == pytest.approx(expected, rel=1e-7)


def test_pairs_are_alike_in_force_and_differ_in_tilt():
    apart = 0.03
    wide, narrow = (
        loaded_arrangement(a(bearing(), apart, 200.0), (0.0, 0.0, 0.0)) for a in (back_to_back, face_to_face)
    )
    assert np.diag(wide.stiffness)[:2] == pytest.approx(np.diag(narrow.stiffness)[:2], rel=1e-9)
    alone = loaded_bearing(bearing(), (200.0, 0.0, 0.0)).stiffness
    for pair, sign in ((wide, 1.0), (narrow, -1.0)):
        expected = 2.0 * alone[2, 2] + apart**2 / 2.0 * alone[1, 1] + sign * 2.0 * apart * alone[1, 2]
        assert pair.stiffness[2, 2] == pytest.approx(expected, rel=1e-7)
    assert wide.stiffness[2, 2] > narrow.stiffness[2, 2]


def test_a_locked_pair_carries_more_at_speed():
    pair = back_to_back(bearing(), 0.03, 200.0)
    resting, running = (loaded_arrangement(pair, (0.0, 0.0, 0.0), rpm * RPM) for rpm in (0.0, 20000.0))
    locked = axisymmetric_state(bearing(), 200.0, np.array([20000.0 * RPM]), "rigid")
    assert resting.bearings[0].load[0] == pytest.approx(200.0, rel=1e-8)
    assert running.bearings[0].load[0] == pytest.approx(locked.axial_load[0], rel=1e-8)
    assert running.bearings[0].load[0] > 250.0


def test_what_cannot_be_carried_says_so():
    with pytest.raises(NoEquilibrium, match="does not carry an axial force of -50 N"):
        loaded_bearing(bearing(), (-50.0, 0.0, 0.0))
    with pytest.raises(InvalidInput, match="three finite numbers"):
        loaded_bearing(bearing(), (1.0, math.nan, 0.0))
    with pytest.raises(InvalidInput, match="at least 0"):
        displaced_bearing(bearing(), np.zeros(3), -1.0)
    with pytest.raises(InvalidInput, match="hold no preload"):
        back_to_back(bearing(), 0.02, 100.0).__class__(
            bearing=bearing(), position=(0.0, 0.02), direction=(1, 1), preload=100.0
        )
