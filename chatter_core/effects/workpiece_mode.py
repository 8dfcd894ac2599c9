"""A flexible workpiece or fixture: one more mode in the cut, which no measurement at the tool shows."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from chatter_core.effects._base import Effect, Scan, Setting
from chatter_core.machine import Machine
from chatter_core.parameters import Array, Parameter
from chatter_core.tip import AXES, OVER_SPEED, TipModes


@dataclass(frozen=True, kw_only=True)
class WorkpieceMode(Effect):
    """m q'' + 2 zeta w m q' + k q = F in x or y: the chip feels tool and workpiece apart, so their receptances add.

    The cut pushes the workpiece as it pushes the tool, the other way; only the distance between them counts.
    The mode gets the next number after the tip's and is in the cut alone, not in the tip's receptance. Valid for
    one dominant mode at the place of the cut.

    Source: Y. Altintas, Manufacturing Automation, 2nd ed. (2012), chapter 4 (relative receptance of tool and
    workpiece); E. Budak et al., CIRP Ann. 61 (2012) 339-342.

    See docs/physics.md#workpiece-mode.
    """

    axis: str

    stage: ClassVar[str] = "cut_modes"
    shapes: ClassVar[tuple[str, ...]] = ("natural_frequency_hz", "damping_ratio")
    heard: ClassVar[str | None] = "natural_frequency_hz"
    # Six per cent apart: narrower lobes than these hold no cuts to tell them.
    scan: ClassVar[Scan | None] = Scan(parameter="natural_frequency_hz", values=tuple(200.0 * 1.06 ** np.arange(34)))
    changes: ClassVar[tuple[str, ...]] = ("cut",)
    settings: ClassVar[tuple[Setting, ...]] = (Setting(name="axis", doc="direction it gives in", choices=AXES),)
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="compliance_um_n", unit="um/N", doc="static compliance 1/k of the workpiece at the cut",
            prior_width=0.5, search_width=0.1, lower=0.0, upper=100.0,
        ),
        Parameter(
            name="natural_frequency_hz", unit="Hz", doc="natural frequency of the workpiece",
            prior_mean=800.0, null=800.0, prior_width=500.0, lower=20.0, upper=8000.0,
        ),
        Parameter(
            name="damping_ratio", unit="", doc="damping ratio of the workpiece",
            prior_mean=0.02, null=0.02, prior_width=0.015, lower=0.001, upper=0.3,
        ),
    )  # fmt: skip

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the modes in the cut with one more."""
        compliance, frequency, damping = values
        mass = 1.0 / (compliance * frequency**2)
        added = dict(zip(OVER_SPEED, (frequency, damping, mass, 1.0), strict=True))

        def cut_modes(modes: TipModes, spindle_speed: Array) -> TipModes:
            tip: TipModes = before(modes, spindle_speed)
            column = np.ones((len(spindle_speed), 1))
            columns = {
                name: np.concatenate([getattr(tip, name), value * column], axis=1) for name, value in added.items()
            }
            own = None if tip.gyroscopic is None else np.pad(tip.gyroscopic, ((0, 0), (0, 1), (0, 1)))
            turn = None if tip.turn is None else np.pad(tip.turn, ((0, 0), (0, 1)))
            return TipModes(
                gyroscopic=own,
                turn=turn,
                axis=np.append(tip.axis, AXES.index(self.axis)),
                label=np.append(tip.label, tip.label.max() + 1),
                **columns,
            )

        return cut_modes
