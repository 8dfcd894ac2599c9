"""The whole chain in one call, for notebooks and scripts: in the units of the shop, results that tell themselves.

import numpy as np
import chatter_core

machine = chatter_core.read_machine("machine.yaml")
lobes = chatter_core.stability_lobes(machine, np.linspace(4000, 20000, 161))
lobes.limit_depth_mm
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter_core.cards import Card, ShownAsCard
from chatter_core.chain import structure_variables
from chatter_core.effects import activate, apply_effects
from chatter_core.errors import InvalidInput
from chatter_core.floquet import MethodSettings
from chatter_core.lobes import lobe_block
from chatter_core.machine import Machine
from chatter_core.units import SUFFIXES
from chatter_core.variables import WITH_RESULT

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, repr=False)
class Lobes(ShownAsCard):
    """Lobes of a machine over spindle speed, and the structure that they come from.

    spindle_speed_rpm (speed,); limit_depth_mm (speed, crossing): stability is lost at the first, third, ..., regained
    between, padded with NaN; chatter_frequency_hz and dominant_mode (speed,) at the first; natural_frequency_hz
    (speed, axis, mode) and radial_stiffness_n_um (speed,) of one bearing, NaN for measured modes; deepest_mm: down to
    which limits were looked for; known (speed,): whether they were found, False where the model has no answer.
    """

    spindle_speed_rpm: Array
    limit_depth_mm: Array
    chatter_frequency_hz: Array
    dominant_mode: NDArray[np.int8]
    natural_frequency_hz: Array
    radial_stiffness_n_um: Array
    deepest_mm: float
    known: NDArray[np.bool_]

    @property
    def first_limit_mm(self) -> Array:
        """The shallowest limit depth of each speed (speed,), NaN where none is found or known."""
        return self.limit_depth_mm[:, 0]

    def card(self) -> Card:
        """Return the shallowest and the deepest limit, and what chatters there."""
        speed, limit = self.spindle_speed_rpm, self.first_limit_mm
        title = f"Lobes at {len(speed)} spindle speeds, {speed[0]:g} to {speed[-1]:g} rpm"
        lost = int((~self.known).sum())
        if lost:
            title += f"; no result at {lost} of them"
        if lost == len(speed):
            return Card(title=title, rows=())
        if not np.isfinite(limit).any():
            return Card(title=title, rows=((f"stable down to {self.deepest_mm:g} mm",),))
        reached = np.where(self.known, np.nan_to_num(limit, nan=self.deepest_mm), -np.inf)
        least, most = int(np.nanargmin(limit)), int(reached.argmax())
        return Card(title=title, rows=(self._row("shallowest", least), self._row("deepest", most)))

    def _row(self, name: str, at: int) -> tuple[str, ...]:
        limit, speed = self.first_limit_mm[at], f"at {self.spindle_speed_rpm[at]:g} rpm"
        if not np.isfinite(limit):
            return f"{name} limit", f"more than {self.deepest_mm:g} mm", speed, ""
        chatter = f"mode {self.dominant_mode[at]} at {self.chatter_frequency_hz[at]:.4g} Hz"
        return f"{name} limit", f"{limit:.3g} mm", speed, chatter


def stability_lobes(
    machine: Machine,
    spindle_speed_rpm: ArrayLike,
    *,
    deepest_mm: float = 10.0,
    mode_count: int = 4,
    modal_parameters: str = "dynamic",
    effects: Mapping[str, Mapping[str, Any]] | None = None,
) -> Lobes:
    """Return the lobes of a machine at spindle speeds (speed,) [rpm].

    deepest_mm: depth down to which limits are looked for; mode_count: modes kept on each axis; modal_parameters:
    ``dynamic`` (bearings at speed) or ``static`` (at standstill); effects: those that are on, each with its values.

    Raises InvalidInput for speeds and depths that are not positive, an effect that is not known or cannot act on the
    machine, more modes than it has or none, and modal parameters that are neither.

    See docs/physics.md#lobes.
    """
    speed_rpm = np.atleast_1d(np.asarray(spindle_speed_rpm, dtype=float))
    if speed_rpm.ndim != 1 or not np.all(np.isfinite(speed_rpm) & (speed_rpm > 0.0)):
        raise InvalidInput(["spindle_speed_rpm: allowed: numbers more than 0, one or a list"])
    if not 0.0 < deepest_mm < np.inf:
        raise InvalidInput([f"deepest_mm: found {deepest_mm:g}, allowed: more than 0"])
    model = apply_effects(machine, [activate(name, values) for name, values in (effects or {}).items()])
    speed = speed_rpm * SUFFIXES["rpm"][0]
    shared: dict[str, Any] = {"mode_count": mode_count, "modal_parameters": modal_parameters}
    found = structure_variables(model, speed, **shared)
    block = lobe_block(
        model,
        spindle_speed=speed,
        axial_depth=np.array([deepest_mm * SUFFIXES["mm"][0]]),
        method=MethodSettings(name="collocation", tolerance=1e-4),
        cells="adaptive",
        **shared,
    )
    # What was searched in part, or chatters from the shallowest depths on, has no crossing either.
    stable = (block.spectral_radius[:, -1] < 1.0) & (block.limits_complete == 1)
    known = np.isfinite(block.limit_depth[:, 0]) | (stable & np.isin(block.status, WITH_RESULT).all(axis=1))
    return Lobes(
        spindle_speed_rpm=speed_rpm,
        limit_depth_mm=block.limit_depth / SUFFIXES["mm"][0],
        chatter_frequency_hz=block.limit_chatter_frequency[:, 0] / SUFFIXES["hz"][0],
        dominant_mode=block.limit_dominant_mode[:, 0],
        natural_frequency_hz=found["natural_frequency"] / SUFFIXES["hz"][0],
        radial_stiffness_n_um=found["radial_stiffness"] / SUFFIXES["n_um"][0],
        deepest_mm=deepest_mm,
        known=known,
    )
