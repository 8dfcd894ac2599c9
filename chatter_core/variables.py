"""Every named result: its dimensions, unit, type and meaning, declared once.

Stores, tables and figures take names, units and descriptions from here. Values are in the unit
of the border (``unit``); ``si_factor`` leads back to SI.
"""

from dataclasses import dataclass, replace

import numpy as np

from chatter_core.units import SUFFIXES

#: The only dimensions that a result may have.
DIMENSIONS = (
    *("modal_parameters", "preload", "mode_count", "spindle_speed", "axial_depth", "crossing", "mode", "axis"),
    *("machine", "cut", "input_key"),
)

#: Outcome of one grid cell. A cell that was never computed is 0: a store is complete when none is left.
#: An interpolated cell lies between depths that were computed.
STATUS = {
    "pending": 0,
    "ok": 1,
    "not_converged": 2,
    "outside_validity": 3,
    "worker_lost": 4,
    "interpolated": 5,
    "timed_out": 6,
}
#: Those with a result, and those that leave a cell without a result.
WITH_RESULT = (STATUS["ok"], STATUS["interpolated"])
FAILED = tuple(STATUS[name] for name in ("not_converged", "outside_validity", "worker_lost", "timed_out"))

#: How stability is lost, from the critical multiplier.
BIFURCATION = {"none": 0, "hopf": 1, "flip": 2, "fold": 3}

#: Where the bearings' stiffness is taken: at the spindle's speed, or at standstill whatever the speed.
MODAL_PARAMETERS = ("dynamic", "static")


@dataclass(frozen=True, kw_only=True)
class Variable:
    """A named result. ``suffix`` is the unit suffix of the border ("" for pure numbers, None where entries differ)."""

    dims: tuple[str, ...]
    dtype: str
    suffix: str | None = ""
    doc: str

    @property
    def unit(self) -> str | None:
        """Unit as CF metadata writes it, None where entries differ: then there is none that holds for all."""
        if self.suffix is None:
            return None
        return SUFFIXES[self.suffix][1] if self.suffix else "1"

    @property
    def si_factor(self) -> float:
        """What a stored value is multiplied by to become SI."""
        return SUFFIXES[self.suffix][0] if self.suffix else 1.0

    def without_result(self, shape: tuple[int, ...]) -> np.ndarray:
        """Return an array of it that holds nothing: NaN, and the code 0."""
        return np.full(shape, np.nan if self.dtype.startswith("f") else 0, dtype=self.dtype)


_LINE = ("modal_parameters", "preload", "mode_count", "spindle_speed")
_CELL = (*_LINE, "axial_depth")
_LIMIT = (*_LINE, "crossing")
_STRUCTURE = ("modal_parameters", "preload", "spindle_speed")

#: What a sweep writes chunk by chunk.
SWEEP: dict[str, Variable] = {
    "spectral_radius": Variable(
        dims=_CELL,
        dtype="f8",
        doc="largest modulus of the Floquet multipliers, per tooth period; to the tolerance near one",
    ),
    "multiplier_angle": Variable(
        dims=_CELL, dtype="f8", suffix="rad", doc="argument of the critical Floquet multiplier"
    ),
    "chatter_frequency": Variable(
        dims=_CELL, dtype="f8", suffix="hz", doc="strongest line of the critical multiplier's branch at the tool tip"
    ),
    "bifurcation": Variable(dims=_CELL, dtype="i1", doc="how stability is lost: 1 Hopf, 2 flip, 3 fold"),
    "dominant_mode": Variable(dims=_CELL, dtype="i1", doc="mode with the largest share in the critical motion"),
    "dominant_mode_share": Variable(dims=_CELL, dtype="f4", doc="its share of the critical motion's energy"),
    "error_estimate": Variable(dims=_LINE, dtype="f8", doc="estimated error of the spectral radius near the boundary"),
    "limits_complete": Variable(
        dims=_LINE, dtype="i1", doc="1 where the search for limit depths left no interval of depth suspicious"
    ),
    "limit_depth": Variable(
        dims=_LIMIT, dtype="f8", suffix="mm", doc="depth at which the spectral radius is one, from the shallowest on"
    ),
    "limit_chatter_frequency": Variable(dims=_LIMIT, dtype="f8", suffix="hz", doc="chatter frequency at the crossing"),
    "limit_dominant_mode": Variable(dims=_LIMIT, dtype="i1", doc="dominant mode at the crossing"),
    "limit_bifurcation": Variable(dims=_LIMIT, dtype="i1", doc="how stability is lost at the crossing"),
}

#: Completion and outcome of every cell, written after everything else of its chunk.
CELL_STATUS = Variable(
    dims=_CELL,
    dtype="u1",
    doc="0 pending, 1 ok, 2 not converged, 3 outside validity, 4 worker lost, 5 interpolated, 6 timed out",
)

#: What depends on speed and preload alone; written once, before the chunks.
STRUCTURE: dict[str, Variable] = {
    "radial_stiffness": Variable(dims=_STRUCTURE, dtype="f8", suffix="n_um", doc="radial stiffness of one bearing"),
    "axial_stiffness": Variable(dims=_STRUCTURE, dtype="f8", suffix="n_um", doc="axial stiffness of one bearing"),
    "inner_contact_angle": Variable(dims=_STRUCTURE, dtype="f8", suffix="deg", doc="contact angle at the inner race"),
    "outer_contact_angle": Variable(dims=_STRUCTURE, dtype="f8", suffix="deg", doc="contact angle at the outer race"),
    "centrifugal_force": Variable(dims=_STRUCTURE, dtype="f8", suffix="n", doc="centrifugal force on one ball"),
    "gyroscopic_moment": Variable(dims=_STRUCTURE, dtype="f8", suffix="n_m", doc="gyroscopic moment on one ball"),
    "natural_frequency": Variable(
        dims=(*_STRUCTURE, "axis", "mode"), dtype="f8", suffix="hz", doc="undamped natural frequency of the tip mode"
    ),
    "damping_ratio": Variable(dims=(*_STRUCTURE, "axis", "mode"), dtype="f8", doc="damping ratio of the tip mode"),
    "modal_stiffness": Variable(
        dims=(*_STRUCTURE, "axis", "mode"), dtype="f8", suffix="n_um", doc="modal stiffness, mode one at the tool tip"
    ),
    "modal_mass": Variable(
        dims=(*_STRUCTURE, "axis", "mode"), dtype="f8", suffix="kg", doc="modal mass, mode one at the tool tip"
    ),
    "tracking_confidence": Variable(
        dims=(*_STRUCTURE, "mode"),
        dtype="f8",
        doc="least modal assurance on the way from standstill (1: surely the same), of x and y the lesser",
    ),
}


def _of_machines(variable: Variable) -> Variable:
    """Return a variable of the structure as every machine of a data set has it."""
    return replace(variable, dims=("machine", *variable.dims[2:]), dtype="f4")


def _of_cuts(variable: Variable, doc: str) -> Variable:
    """Return a variable of the limit depths as every cut of a data set has it, of the first crossing alone."""
    dtype = variable.dtype.replace("f8", "f4")
    return replace(variable, dims=("machine", "cut", "spindle_speed"), dtype=dtype, doc=doc)


#: What a data set holds of every machine and of every cut, written chunk by chunk.
DATASET: dict[str, Variable] = {
    **{name: _of_machines(variable) for name, variable in STRUCTURE.items()},
    "limit_depth": _of_cuts(
        SWEEP["limit_depth"], "depth at which stability is lost first; NaN where it is not, down to the deepest"
    ),
    "limit_chatter_frequency": _of_cuts(SWEEP["limit_chatter_frequency"], "chatter frequency at the limit depth"),
    "limit_dominant_mode": _of_cuts(SWEEP["limit_dominant_mode"], "dominant mode at the limit depth; 0 where none is"),
    "limit_bifurcation": _of_cuts(
        SWEEP["limit_bifurcation"], "how stability is lost at the limit depth: 0 not at all, 1 Hopf, 2 flip, 3 fold"
    ),
    "limits_complete": _of_cuts(SWEEP["limits_complete"], SWEEP["limits_complete"].doc),
    "error_estimate": _of_cuts(SWEEP["error_estimate"], SWEEP["error_estimate"].doc),
}

#: What a data set knows of its machines before they are computed.
DATASET_INPUTS: dict[str, Variable] = {
    "input": Variable(
        dims=("machine", "cut", "input_key"),
        dtype="f8",
        suffix=None,
        doc="what varies, in its key's unit; words by their place",
    ),
    "split": Variable(dims=("machine",), dtype="i1", doc="0 train, 1 validation, 2 test; all cuts of a machine alike"),
}

#: Completion and outcome of every cut at every speed, written after everything else of its chunk.
CUT_STATUS = replace(
    CELL_STATUS,
    dims=("machine", "cut", "spindle_speed"),
    doc="0 pending, 1 ok, 2 not converged, 3 outside validity, 4 worker lost, 6 timed out",
)
