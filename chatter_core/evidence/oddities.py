"""What can be read in a campaign and is yet hardly meant: other units, another sign convention, values that go unused.

Every oddity is a remark, told beside the answer; none keeps a campaign from being read.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from chatter_core.evidence.measured import OUTCOMES, STABILITY, Receptance
from chatter_core.evidence.table import Rows
from chatter_core.machine import Machine
from chatter_core.parameters import Array
from chatter_core.units import si_factor

#: Receptances of tool tips that are met [m/N], by the median over frequency.
USUAL_RECEPTANCE = (1e-9, 1e-4)
#: No campaign is cut so slowly, or so little deep, throughout [rpm, mm].
LEAST_USUAL_RPM, LEAST_USUAL_MM = 60.0, 0.01
#: Chatter is no slower than this share of the revolutions.
LEAST_REVOLUTIONS = 0.1
#: Share of the imaginary part in a response's peak beyond which its sign is that of a resonance.
CLEAR_SIGN = 0.5


def oddities(rows: Mapping[str, Rows], receptances: Sequence[Receptance], machine: Machine) -> list[str]:
    """Return what can be read and is yet hardly meant.

    See docs/physics.md#comparison.
    """
    remarks = [remark for receptance in receptances for remark in odd_receptance(receptance)]
    trials = rows.get(STABILITY.file)
    if trials is not None:
        stable = trials.codes("outcome") == OUTCOMES.index("stable")
        noted = trials.line[stable & ~np.isnan(trials.columns["chatter_frequency"])]
        if len(noted):
            remarks.append(
                f"{STABILITY.file}: {len(noted)} stable trials name a chatter frequency, line {noted[0]} the first; "
                "it is not used"
            )
        remarks += unused_preloads(STABILITY.file, trials.columns["preload"], machine)
        remarks += _odd_trials(trials)
    return remarks


def unused_preloads(file: str, preload: Array, machine: Machine) -> list[str]:
    """Return what is to be told of preloads [N] that cuts of a file state (trial,), where the machine knows none.

    See docs/physics.md#comparison.
    """
    if machine.spindle is not None or np.isnan(preload).all():
        return []
    return [f"{file}: preload_n is not used, the machine's measured tip modes know no preload"]


def odd_receptance(receptance: Receptance) -> list[str]:
    """Return what speaks for another unit or another sign convention in a response.

    See docs/physics.md#comparison.
    """
    remarks = []
    least, most = USUAL_RECEPTANCE
    usual = float(np.median(np.abs(receptance.value)))
    if not least <= usual <= most:
        remarks.append(
            f"{receptance.source}: receptance {receptance} has a median of {usual * 1e6:.3g} um/N, usual are "
            f"{least * 1e6:g} to {most * 1e6:g}; is its unit right?"
        )
    peak = receptance.value[np.argmax(np.abs(receptance.value))]
    if receptance.is_direct and peak.imag > CLEAR_SIGN * abs(peak):
        remarks.append(
            f"{receptance.source}: receptance {receptance} has a positive imaginary part at its peak; it is negative "
            "with exp(+i w t), so force or displacement is probably turned round, or the convention is another"
        )
    return remarks


def _odd_trials(trials: Rows) -> list[str]:
    """Return what speaks for another unit in trial cuts, or for thousands that are separated."""
    speed, depth, frequency = (trials.columns[name] for name in ("spindle_speed", "axial_depth", "chatter_frequency"))
    remarks = []
    for values, least, what in (
        (speed / si_factor("spindle_speed_rpm"), LEAST_USUAL_RPM, "spindle_speed_rpm"),
        (depth / si_factor("axial_depth_mm"), LEAST_USUAL_MM, "axial_depth_mm"),
    ):
        if values.max() < least:
            remarks.append(
                f"{STABILITY.file}: {what} is {values.max():.4g} at most; is its unit right, and are thousands not "
                "separated?"
            )
    slow = np.flatnonzero(frequency < LEAST_REVOLUTIONS * speed)
    if len(slow):
        remarks.append(
            f"{STABILITY.file}: chatter frequencies below a tenth of the spindle's revolutions: {len(slow)}, the first "
            f"in line {trials.line[slow].min()}; is their unit right?"
        )
    return remarks
