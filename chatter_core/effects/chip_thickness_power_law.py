"""Cutting force not proportional to chip thickness: thin chips are dearer, so the feed matters."""

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from chatter_core.cutting import SMALLEST_LAG, CuttingGain
from chatter_core.effects._base import Effect
from chatter_core.machine import Machine
from chatter_core.parameters import Array, Parameter
from chatter_core.stages import Regeneration

#: Chip thickness at which the stated coefficients hold [m].
REFERENCE_CHIP = 1e-4
#: Thinner than this a tooth rubs and cuts no thinner chip: a third of an edge radius of 10 um [m].
LEAST_CHIP = 3e-6
#: Gauss points along the engaged part of an edge: 1e-4 of K where an edge lies from no chip to the full one.
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
        flat, own, cut = time.reshape(len(time), -1), self.cut.passages, self.cut
        gain, turn = np.zeros((*flat.shape, 2, 2)), 2.0 * math.pi / own.teeth * own.repeat
        entries, exits = (np.broadcast_to(border, (len(flat), len(own))) for border in (own.entry, own.exit))
        for passage in range(len(own)):
            entry, leave = entries[:, passage, None], exits[:, passage, None]
            lag, ahead = self._lag(passage)[:, None], own.ahead[passage] - cut.lag_angle[:, None] * own.lower[passage]
            steep = np.maximum(lag, SMALLEST_LAG)
            phase = np.mod(cut.spindle_speed[:, None] * flat + ahead, turn)
            last = math.ceil(float((leave + lag).max()) / turn)
            for edge in range(math.floor(float(entry.min()) / turn), last + 1):
                angle = phase + turn * edge
                leaves, enters = (np.clip((angle - border) / steep, 0.0, 1.0) for border in (leave, entry))
                engaged = np.nonzero(enters > leaves)
                if len(engaged[0]):
                    gain[engaged] += self._of_edges(
                        passage, engaged[0], *(one[engaged] for one in (angle, leaves, enters))
                    )
        return gain.reshape(*time.shape, 2, 2)

    def _lag(self, passage: int) -> Array:
        """Return the angle by which the part of the edge lags over its own height (point,) [rad]."""
        return np.asarray(self.cut.lag_angle * self._part(passage))

    def _part(self, passage: int) -> float:
        return float(self.cut.passages.upper[passage] - self.cut.passages.lower[passage])

    def _of_edges(self, passage: int, point: NDArray[np.intp], angle: Array, leaves: Array, enters: Array) -> Array:
        """Return the integrals (edge, 2, 2) over edges (edge,) of points, each between two shares of its height."""
        share = leaves[:, None] + (enters - leaves)[:, None] * 0.5 * (NODES + 1.0)
        theta = angle[:, None] - self._lag(passage)[point, None] * share
        chip = self.cut.passages.select(np.array([passage])).chip_thickness(theta, self.feed_per_tooth)
        thickness = np.hypot(np.maximum(chip, 0.0), LEAST_CHIP) / REFERENCE_CHIP
        part = 0.5 * WEIGHTS * self.exponent * thickness ** (self.exponent - 1.0)
        part *= (self.cut.axial_depth[point] * self._part(passage) * (enters - leaves))[:, None]
        tangential, radial = (
            np.broadcast_to(one, len(self.cut.axial_depth))[point]
            for one in (self.cut.coefficients.tangential, self.cut.coefficients.radial)
        )
        sine, cosine = np.sin(theta), np.cos(theta)
        ss, sc, cc = ((part * product).sum(axis=-1) for product in (sine * sine, sine * cosine, cosine * cosine))
        rows = [[-tangential * sc - radial * ss, -tangential * cc - radial * sc]]
        rows += [[tangential * ss - radial * sc, tangential * sc - radial * cc]]
        return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


@dataclass(frozen=True, kw_only=True)
class ChipThicknessPowerLaw(Effect):
    """F = b K h_ref (h/h_ref)^x for both forces, h_ref = 0.1 mm, about the nominal chip h_0(theta) of feed and runout.

    x below one: thin chips take more energy for their size, and the slope x (h_0/h_ref)^(x - 1) grows without bound
    as h_0 vanishes, where a tooth enters or leaves. No edge is that sharp: h_0 counts as sqrt(h_0^2 + (3 um)^2),
    a third of an edge radius of 10 um, below which it rubs. Valid for vibration small beside the chip.

    Source: O. Kienzle, VDI-Z 94 (1952) 299-305 (x = 1 - m); G. Stepan, R. Szalai, T. Insperger in Nonlinear Dynamics
    of Production Systems (2004) (linearised about the nominal chip).

    See docs/physics.md#chip-thickness-power-law.
    """

    stage: ClassVar[str] = "regeneration"
    changes: ClassVar[tuple[str, ...]] = ("cut",)
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="exponent", unit="", doc="exponent x of the chip thickness in the force",
            null=1.0, prior_mean=1.0, prior_width=0.25, lower=0.3, upper=1.5, touches="cut",
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
