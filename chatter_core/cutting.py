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
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chatter_core.jit import compiled
from chatter_core.machine import Cutting, Process, Tool
from chatter_core.teeth import Engagement, Passages

Array = NDArray[np.float64]

#: Lag angles below this act as none; angles divided by it stay finite [rad].
SMALLEST_LAG = 1e-200


@dataclass(frozen=True, kw_only=True)
class ForceCoefficients:
    """Force per chip area: tangential F_t = tangential b h, radial F_r = radial b h [Pa], one number or (point,)."""

    tangential: float | Array
    radial: float | Array


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


def axial_pitch(tool: Tool) -> float:
    """Return the depth over which a helical edge lags by one tooth [m]: how the cut changes repeats with it.

    Infinite for a straight edge.

    See docs/physics.md#cutting.
    """
    lag = tool.teeth * math.tan(tool.helix_angle)
    return math.pi * tool.diameter / lag if lag > 0.0 else math.inf


class Edges(NamedTuple):
    """What a compiled loop over edges at times takes.

    time (point, time) [s]; spindle_speed [rad/s], axial_depth [m], lag_angle [rad], tangential and radial coefficients
    [Pa] (point,); turn, the angle after which the cut repeats itself [rad]; of the passages ahead [rad], lower and
    upper (passage,), entry and exit (point, passage) [rad].
    """

    time: Array
    spindle_speed: Array
    axial_depth: Array
    lag_angle: Array
    tangential: Array
    radial: Array
    turn: float
    ahead: Array
    lower: Array
    upper: Array
    entry: Array
    exit: Array


@dataclass(frozen=True, kw_only=True)
class CuttingGain:
    """Force on the tip per tip displacement since the surface was left, F = K(t) [w(t) - w(t - tau)].

    One operating point per entry: axial_depth [m] and spindle_speed [rad/s] are (point,). Called
    with times (point, ...) [s] it answers K (point, ..., 2, 2) [N/m], rows F_x, F_y, columns
    w_x, w_y, of all its passages together. The integral over the helical edge is exact, and
    periodic with as many tooth periods as there are teeth before the cut repeats itself.
    """

    axial_depth: Array
    spindle_speed: Array
    tool: Tool
    coefficients: ForceCoefficients
    passages: Passages

    @property
    def lag_angle(self) -> Array:
        """Angle by which the upper end of the edge lags behind its tip (point,) [rad]."""
        return 2.0 * self.axial_depth * math.tan(self.tool.helix_angle) / self.tool.diameter

    @property
    def tooth_period(self) -> Array:
        """Mean time between two teeth (point,) [s]."""
        return 2.0 * math.pi / (self.tool.teeth * self.spindle_speed)

    @property
    def period(self) -> Array:
        """Time after which the cut repeats itself (point,) [s]: a tooth period where all teeth are alike."""
        return self.passages.repeat * self.tooth_period

    def by_delay(self) -> "tuple[tuple[CuttingGain, Array], ...]":
        """Return the gain in parts, each with the one delay (point,) [s] of its passages."""
        parts = self.passages.by_delay()
        return tuple((replace(self, passages=part), float(part.pitches[0]) * self.tooth_period) for part in parts)

    def breakpoints(self) -> Array:
        """Return the times in a period where K is not smooth (point, 4 x passage) [s].

        They are where the tip of an edge begins and ends a passage, and where its upper end does.
        """
        lag, own = self.lag_angle[:, None], self.passages
        ends = (border - own.ahead + lag * part for border in (own.entry, own.exit) for part in (own.lower, own.upper))
        corner = np.concatenate(list(ends), axis=-1)
        # What does not cut at a point breaks nothing there.
        cuts = np.tile(np.broadcast_to(own.exit > own.entry, (len(lag), len(own))), 4)
        first = np.take_along_axis(corner, cuts.argmax(axis=1)[:, None], axis=1)
        corner = np.where(cuts, corner, first)
        return np.asarray(np.mod(corner / self.spindle_speed[:, None], self.period[:, None]))

    def __call__(self, time: Array) -> Array:
        """Return K at times (point, ...) [N/m]."""
        gain = np.zeros((*time.shape, 2, 2))
        _add_edges(self.edges(time), gain.reshape(len(time), -1, 2, 2))
        return gain

    def edges(self, time: Array) -> Edges:
        """Return the edges at times (point, ...) [s]."""
        count, own = len(time), self.passages
        # Of one layout in memory: each other one would be compiled for itself.
        return Edges(
            time=np.ascontiguousarray(time.reshape(count, -1)),
            spindle_speed=np.ascontiguousarray(self.spindle_speed),
            axial_depth=np.ascontiguousarray(self.axial_depth),
            lag_angle=self.lag_angle,
            tangential=np.full(count, self.coefficients.tangential),
            radial=np.full(count, self.coefficients.radial),
            turn=2.0 * math.pi / self.tool.teeth * own.repeat,
            ahead=np.ascontiguousarray(own.ahead),
            lower=np.ascontiguousarray(own.lower),
            upper=np.ascontiguousarray(own.upper),
            entry=np.ascontiguousarray(np.broadcast_to(own.entry, (count, len(own)))),
            exit=np.ascontiguousarray(np.broadcast_to(own.exit, (count, len(own)))),
        )


@compiled
def _add_edges(edges, gain):  # type: ignore[no-untyped-def]
    """Add up the directional matrices (point, time, 2, 2) of all edges in the cut; the cut repeats every turn."""
    for p in range(len(edges.time)):
        tangential, radial = edges.tangential[p], edges.radial[p]
        for q in range(len(edges.ahead)):
            entry, leave, part = edges.entry[p, q], edges.exit[p, q], edges.upper[q] - edges.lower[q]
            if leave <= entry:
                continue
            lag, depth = edges.lag_angle[p] * part, edges.axial_depth[p] * part
            ahead = edges.ahead[q] - edges.lag_angle[p] * edges.lower[q]
            first, stop = math.floor(entry / edges.turn), beyond(leave, lag, edges.turn)
            for t in range(edges.time.shape[1]):
                phase = within_turn(edges.spindle_speed[p] * edges.time[p, t] + ahead, edges.turn)
                for number in range(first, stop):
                    angle = phase + edges.turn * number
                    # Mostly it is not in the cut, and to know by how much would take most of the time.
                    if angle <= entry or angle > leave + max(lag, SMALLEST_LAG):
                        continue
                    leaves, enters = engaged_share(angle, entry, leave, lag)
                    if enters <= leaves:
                        continue
                    engaged, span = 0.5 * depth * (enters - leaves), lag * (enters - leaves)
                    twice = 2.0 * angle - lag * (enters + leaves)
                    ripple = engaged * math.sin(span) / span if span > 0.0 else engaged
                    sine_cosine = ripple * math.sin(twice)
                    sine_sine = engaged - ripple * math.cos(twice)
                    cosine_cosine = engaged + ripple * math.cos(twice)
                    add_direction(tangential, radial, sine_sine, sine_cosine, cosine_cosine, gain[p, t])


@compiled
def within_turn(angle, turn):  # type: ignore[no-untyped-def]
    """Return an angle less its whole turns.

    A remainder would cost more than all else that is done for an edge out of the cut. Rounding may give a whole turn,
    or a little less than none: there neither the first edge nor the last one cuts.

    See docs/physics.md#cutting.
    """
    return angle - turn * math.floor(angle / turn)


@compiled
def beyond(leave, lag, turn):  # type: ignore[no-untyped-def]
    """Return the number of turns ahead from which no edge cuts any more, whatever rounding does to its angle.

    See docs/physics.md#cutting.
    """
    return math.ceil((leave + lag) / turn) + 1


@compiled
def engaged_share(angle, entry, leave, lag):  # type: ignore[no-untyped-def]
    """Return the shares of an edge, from its tip at an angle, between which it is in the cut.

    No difference of nearly equal angles is taken, so a straight edge is the limit and no special case.

    See docs/physics.md#cutting.
    """
    steep = max(lag, SMALLEST_LAG)
    return min(max((angle - leave) / steep, 0.0), 1.0), min(max((angle - entry) / steep, 0.0), 1.0)


@compiled
def add_direction(tangential, radial, sine_sine, sine_cosine, cosine_cosine, gain):  # type: ignore[no-untyped-def]
    """Add the directional matrix of an edge to K (2, 2), by coefficients and sums of products; either has the depth.

    See docs/physics.md#cutting.
    """
    gain[0, 0] -= tangential * sine_cosine + radial * sine_sine
    gain[0, 1] -= tangential * cosine_cosine + radial * sine_cosine
    gain[1, 0] += tangential * sine_sine - radial * sine_cosine
    gain[1, 1] += tangential * sine_cosine - radial * cosine_cosine
