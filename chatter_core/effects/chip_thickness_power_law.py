"""Cutting force not proportional to chip thickness: thin chips are dearer, so the feed matters."""

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar, cast

import numpy as np

from chatter_core.cutting import CuttingGain, add_direction, beyond, engaged_share, within_turn
from chatter_core.effects._base import Effect
from chatter_core.jit import compiled
from chatter_core.machine import Machine
from chatter_core.parameters import Array, Parameter
from chatter_core.stages import Regeneration

#: Chip thickness at which the stated coefficients hold [m].
REFERENCE_CHIP = 1e-4
#: Thinner than this a tooth rubs and cuts no thinner chip: a third of an edge radius of 10 um [m].
LEAST_CHIP = 3e-6
#: Gauss points along the engaged part of an edge. K errs by 2e-4 at most where that lies from no chip to the full one,
#: by 3e-3 where an edge lies in all of a slot at once; both for x = 0.3, and less the nearer x is to one.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True, kw_only=True)
class PowerLawGain:
    """K(t) of a force b K h_ref (h/h_ref)^x, linear in the vibration about the nominal chip h_0.

    Every part of the edge has the coefficient x (h_0/h_ref)^(x - 1) K, with sqrt(h_0^2 + LEAST_CHIP^2) for h_0.
    """

    cut: CuttingGain
    exponent: float
    feed_per_tooth: float

    def __call__(self, time: Array) -> Array:
        """Return K at times (point, ...) [N/m]."""
        gain, own = np.zeros((*time.shape, 2, 2)), self.cut.passages
        feed = self.feed_per_tooth * own.pitches
        _add_slopes(self.cut.edges(time), feed, own.longer.copy(), self.exponent, gain.reshape(len(time), -1, 2, 2))
        return gain


@compiled
def _add_slopes(edges, feed, longer, exponent, gain):  # type: ignore[no-untyped-def]
    """Add up the directional matrices (point, time, 2, 2) of all edges in the cut, with the law's slope along each.

    feed, longer: (passage,), the nominal chip is feed sin(theta) + longer [m].
    """
    for p in range(len(edges.time)):
        for q in range(len(edges.ahead)):
            entry, leave, part = edges.entry[p, q], edges.exit[p, q], edges.upper[q] - edges.lower[q]
            if leave <= entry:
                continue
            lag, ahead = edges.lag_angle[p] * part, edges.ahead[q] - edges.lag_angle[p] * edges.lower[q]
            for t in range(edges.time.shape[1]):
                phase = within_turn(edges.spindle_speed[p] * edges.time[p, t] + ahead, edges.turn)
                for number in range(math.floor(entry / edges.turn), beyond(leave, lag, edges.turn)):
                    angle = phase + edges.turn * number
                    leaves, enters = engaged_share(angle, entry, leave, lag)
                    if enters <= leaves:
                        continue
                    sine_sine, sine_cosine, cosine_cosine = 0.0, 0.0, 0.0
                    for node in range(len(NODES)):
                        theta = angle - lag * (leaves + (enters - leaves) * 0.5 * (NODES[node] + 1.0))
                        sine, cosine = math.sin(theta), math.cos(theta)
                        chip = max(feed[q] * sine + longer[q], 0.0)
                        thickness = math.sqrt(chip**2 + LEAST_CHIP**2) / REFERENCE_CHIP
                        slope = 0.5 * WEIGHTS[node] * exponent * thickness ** (exponent - 1.0)
                        sine_sine += slope * sine**2
                        sine_cosine += slope * sine * cosine
                        cosine_cosine += slope * cosine**2
                    depth = edges.axial_depth[p] * part * (enters - leaves)
                    tangential, radial = depth * edges.tangential[p], depth * edges.radial[p]
                    add_direction(tangential, radial, sine_sine, sine_cosine, cosine_cosine, gain[p, t])


@dataclass(frozen=True, kw_only=True)
class ChipThicknessPowerLaw(Effect):
    """F = b K h_ref (h/h_ref)^x for both forces, h_ref = 0.1 mm, about the nominal chip h_0(theta) of feed and runout.

    Thin chips take more energy for their size, never less: x is Kienzle's 1 - m, at most one. The slope
    x (h_0/h_ref)^(x - 1) grows without bound as h_0 vanishes, where a tooth enters or leaves. No edge is that sharp:
    h_0 counts as sqrt(h_0^2 + (3 um)^2), a third of an edge radius of 10 um, below which it rubs. Valid for vibration
    small beside the chip.

    Source: O. Kienzle, VDI-Z 94 (1952) 299-305 (x = 1 - m); G. Stepan, R. Szalai, T. Insperger in Nonlinear Dynamics
    of Production Systems (2004) (linearised about the nominal chip).

    See docs/physics.md#chip-thickness-power-law.
    """

    stage: ClassVar[str] = "regeneration"
    changes: ClassVar[tuple[str, ...]] = ("cut",)
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="exponent", unit="", doc="exponent x of the chip thickness in the force",
            null=1.0, prior_mean=1.0, prior_width=0.25, lower=0.3, upper=1.0, touches="cut",
        ),
    )  # fmt: skip

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the feedback of the cut with the slope of the power law."""
        (exponent,) = values
        feed = machine.process.feed_per_tooth

        def regeneration(gain: CuttingGain) -> Regeneration:
            cut: Regeneration = before(gain)
            feedback = tuple(
                replace(
                    term, gain=PowerLawGain(cut=cast(CuttingGain, term.gain), exponent=exponent, feed_per_tooth=feed)
                )
                for term in cut.feedback
            )
            return replace(cut, feedback=feedback)

        return regeneration
