"""Cutting: from tooth, immersion and helix to the force that a tip displacement causes.

The tooth angle theta is counted clockwise from +y, the feed points along +x. A tooth cuts the
chip thickness h = dx sin(theta) + dy cos(theta), dx and dy being what the tip has moved since the
tooth before it passed. The edge at height z lags by 2 z tan(helix) / diameter.

Source: the force model of B. Balachandran, "Nonlinear dynamics of milling processes", Phil. Trans.
R. Soc. A 359 (2001) 793-819, as used in "Effects of spindle speed-dependent dynamic
characteristics of ball bearing and multi-modes on the stability of milling processes", equations
20-29; the sign in the row vector of its equation 22 is a misprint.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter_core.machine import Cutting, Process, Tool

Array = NDArray[np.float64]

#: Lag angles below this act as none; angles divided by it stay finite [rad].
SMALLEST_LAG = 1e-200


@dataclass(frozen=True, kw_only=True)
class ForceCoefficients:
    """Force per chip area: tangential F_t = tangential b h, radial F_r = radial b h [Pa]."""

    tangential: float
    radial: float


@dataclass(frozen=True, kw_only=True)
class Engagement:
    """Angles at which a tooth enters and leaves the workpiece [rad], 0 <= entry < exit <= pi."""

    entry: float
    exit: float


def force_coefficients(cutting: Cutting, tool: Tool) -> ForceCoefficients:
    """Return the coefficients of the paper: k2 k_t tangentially and k1 k_t radially.

    k1 = k_n / cos(helix), k2 = 1 + tan(helix) mu (cos(rake) - k_n sin(rake)).
    Source: equation 23 of the paper named above.

    See docs/physics.md#cutting.
    """
    k1 = cutting.kn / math.cos(tool.helix_angle)
    k2 = 1.0 + math.tan(tool.helix_angle) * cutting.friction_coefficient * (
        math.cos(tool.rake_angle) - cutting.kn * math.sin(tool.rake_angle)
    )
    return ForceCoefficients(
        tangential=k2 * cutting.specific_cutting_energy, radial=k1 * cutting.specific_cutting_energy
    )


def engagement(process: Process) -> Engagement:
    """Return the engagement of up, down and slot milling.

    See docs/physics.md#cutting.
    """
    chord = 1.0 - 2.0 * process.radial_immersion
    if process.direction == "up":
        return Engagement(entry=0.0, exit=math.acos(chord))
    if process.direction == "down":
        return Engagement(entry=math.acos(-chord), exit=math.pi)
    return Engagement(entry=0.0, exit=math.pi)


@dataclass(frozen=True, kw_only=True)
class CuttingGain:
    """Force on the tip per tip displacement since the last tooth, F = K(t) [w(t) - w(t - tau)].

    One operating point per entry: axial_depth [m] and spindle_speed [rad/s] are (point,). Called
    with times (point, ...) [s] it answers K (point, ..., 2, 2) [N/m], rows F_x, F_y, columns
    w_x, w_y. The integral over the helical edge is exact, and periodic with the tooth period.
    """

    axial_depth: Array
    spindle_speed: Array
    tool: Tool
    coefficients: ForceCoefficients
    engagement: Engagement

    @property
    def lag_angle(self) -> Array:
        """Angle by which the upper end of the edge lags behind its tip (point,) [rad]."""
        return 2.0 * self.axial_depth * math.tan(self.tool.helix_angle) / self.tool.diameter

    @property
    def tooth_period(self) -> Array:
        """Time between two teeth (point,) [s]."""
        return 2.0 * math.pi / (self.tool.teeth * self.spindle_speed)

    def breakpoints(self) -> Array:
        """Return the times in a tooth period where K is not smooth (point, 4) [s].

        They are where the tip of an edge enters and leaves, and where its upper end does.
        """
        lag = self.lag_angle
        entry, leave = np.full_like(lag, self.engagement.entry), np.full_like(lag, self.engagement.exit)
        corner = np.stack([entry, leave, entry + lag, leave + lag], axis=-1)
        return np.asarray(np.mod(corner / self.spindle_speed[:, None], self.tooth_period[:, None]))

    def __call__(self, time: Array) -> Array:
        """Return K at times (point, ...) [N/m]."""
        wide = (slice(None), *(None,) * (time.ndim - 1))
        lag, depth = self.lag_angle[wide][..., None], self.axial_depth[wide][..., None]
        pitch = 2.0 * math.pi / self.tool.teeth
        # Tooth angles of all edges that can be in the cut: an edge is still in after its tip has left.
        edges = math.ceil((self.engagement.exit + float(self.lag_angle.max())) / pitch) + 1
        phase = np.mod(self.spindle_speed[wide] * time, pitch)
        angle = phase[..., None] + pitch * np.arange(edges)
        # The share of the edge, from its tip, at which it leaves and enters: no difference of nearly
        # equal angles is taken, so a straight edge is the limit and no special case.
        steep = np.maximum(lag, SMALLEST_LAG)
        leaves = np.clip((angle - self.engagement.exit) / steep, 0.0, 1.0)
        enters = np.clip((angle - self.engagement.entry) / steep, 0.0, 1.0)
        share = enters - leaves
        return self._directional_matrix(depth * share, lag * share, angle - 0.5 * lag * (enters + leaves))

    def _directional_matrix(self, engaged: Array, span: Array, middle: Array) -> Array:
        """Integrate the directional coefficients over arcs of given engaged length [m], span and middle [rad]."""
        ripple = np.sinc(span / math.pi)  # sin(span) / span
        sine_sine = (engaged * (1.0 - ripple * np.cos(2.0 * middle))).sum(axis=-1) / 2.0
        cosine_cosine = (engaged * (1.0 + ripple * np.cos(2.0 * middle))).sum(axis=-1) / 2.0
        sine_cosine = (engaged * ripple * np.sin(2.0 * middle)).sum(axis=-1) / 2.0
        tangential, radial = self.coefficients.tangential, self.coefficients.radial
        gain = np.empty((*sine_sine.shape, 2, 2))
        gain[..., 0, 0] = -tangential * sine_cosine - radial * sine_sine
        gain[..., 0, 1] = -tangential * cosine_cosine - radial * sine_cosine
        gain[..., 1, 0] = tangential * sine_sine - radial * sine_cosine
        gain[..., 1, 1] = tangential * sine_cosine - radial * cosine_cosine
        return gain
