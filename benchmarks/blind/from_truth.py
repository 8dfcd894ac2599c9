"""Whether the search for an effect comes as high as fits that begin at what is hidden.

``python -m benchmarks.blind.from_truth FOLDER SEED...`` takes seeds that hide one effect. Where fits from about the
truth end higher than the search it is the search that misses something; where they do not, these measurements do not
show it. For seeds of the calibration, and of tests that have been opened: it looks at what is hidden.
"""

import argparse
import math
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.blind.kept_rows import keep_row, kept_rows
from benchmarks.blind.shared_amplitudes import AXES, JOINTS, cosine, free_ring, variation, workpiece
from benchmarks.blind.summary import markdown
from benchmarks.blind.tables import write_rows
from chatter_core.effects.directional_asymmetry import REFERENCE_PRELOAD
from chatter_core.evidence import Comparison, base_model, calibrate, read_campaign
from chatter_core.evidence.belief import PRIORS
from chatter_core.evidence.candidates import Candidate, Hypothesis, extended
from chatter_core.evidence.fit import Fit, free_parameters, maximise
from chatter_core.evidence.parameters import Parameter, column
from chatter_core.evidence.pursuit import LEFT_GAIN, fit_hypothesis, ground, refit
from chatter_core.parameters import Array
from pipeline.diagnosis import candidates_of
from pipeline.model_file import Content
from tests.hidden_effect.campaign import Shop, draw_shop
from tests.hidden_effect.design import plan
from tests.hidden_effect.effects import seat_compliance
from tests.hidden_effect.hidden import Hidden
from tests.hidden_effect.machine import Machine

#: Folder of the rows that are kept, and the table's name.
TABLE = "from_truth"
#: Axial depth at which a width of cut that falls with depth is taken [m].
USUAL_DEPTH_M = 2e-3
#: Angles between an offset and the first tooth from which a fit with runout begins [degree].
PHASES = (-150.0, -90.0, -30.0, 30.0, 90.0, 150.0)

Values = dict[str, float]


@dataclass(frozen=True, kw_only=True)
class Beginning:
    """Where fits of an effect begin: in which variant, and with which values of its parameters, in their units."""

    values: list[Values]
    settings: dict[str, str]


def _beginning(*values: Values, **settings: str) -> Beginning:
    return Beginning(values=list(values), settings=settings)


def _ring(hidden: Hidden, machine: Machine) -> Beginning:
    return _beginning({"growth_um": 1e6 * hidden.ring_growth * free_ring(asdict(machine.bearing))})


def _joint(hidden: Hidden, machine: Machine) -> Beginning:
    lateral, rotational = 1e6 * hidden.joint_lateral_m_n, 1e6 * hidden.joint_rotational_rad_nm
    values = {"lateral_compliance_um_n": lateral, "rotational_compliance_urad_n_m": rotational}
    return _beginning(values, joint=JOINTS[hidden.joint_border])


def _housing(hidden: Hidden, machine: Machine) -> Beginning:
    difference = math.log(hidden.rear_seat_m_n / hidden.front_seat_m_n)
    return _beginning({"compliance_um_n": 1e6 * hidden.front_seat_m_n, "rear_difference": difference})


def _workpiece(hidden: Hidden, machine: Machine) -> Beginning:
    (mode,) = hidden.foreign_modes
    axis = AXES[mode.axis]
    return _beginning(workpiece(asdict(mode), {"axis": axis}), axis=axis)


def _damping(hidden: Hidden, machine: Machine) -> Beginning:
    rise = hidden.damping_rise / (1.0 + (hidden.damping_half_rpm / 10000.0) ** 2)
    return _beginning({"change": math.log(1.0 + rise)})


def _asymmetry(hidden: Hidden, machine: Machine) -> Beginning:
    share = hidden.front_seat_y_m_n / seat_compliance(replace(machine, preload_n=REFERENCE_PRELOAD))
    # A rear seat that does not give at all is one that gives a twentieth: the program's law goes no lower.
    difference = math.log(max(hidden.rear_seat_y_share, 0.05))
    # What is hidden turns from y towards x, what is fitted from x towards y.
    shape = {"rear_difference": difference, "turn_deg": -math.degrees(hidden.y_turn_rad)}
    losses = [{"stiffness_loss": math.log(1.0 + part * share), **shape} for part in (0.3, 1.0)]
    return _beginning(*losses, where="seats", axis="y")


def _pitch(hidden: Hidden, machine: Machine) -> Beginning:
    errors = list(hidden.pitch_errors_deg)
    if len(errors) == 3:
        # Pitches of three teeth are all of a cosine.
        whole = cosine(errors)
        sizes = [{**whole, "variation": part * whole["variation"]} for part in (0.5, 0.75, 1.0)]
        return _beginning(*sizes, pattern="sinusoidal")
    by_turns = len(errors) > 2 and errors == np.resize(errors[:2], len(errors)).tolist()
    widest, pattern = variation(errors), "alternating" if by_turns else "linear"
    return _beginning(*({"variation": part * widest} for part in (0.5, 0.75, 1.0)), pattern=pattern)


def _immersion(hidden: Hidden, machine: Machine) -> Beginning:
    offset = hidden.immersion_offset or -hidden.immersion_per_depth_1_m * USUAL_DEPTH_M
    return _beginning({"offset": 0.5 * offset}, {"offset": offset})


def _drawbar(hidden: Hidden, machine: Machine) -> Beginning:
    tilt = 1e6 * hidden.drawbar_rotational_rad_nm
    return _beginning(*({"rotational_compliance_urad_n_m": part * tilt} for part in (0.5, 1.0)), joint=JOINTS[1])


#: Where the program's law of an effect is about as strong as the hidden one; several places where the laws are unlike.
BEGINNINGS: dict[str, Callable[[Hidden, Machine], Beginning]] = {
    "process_damping": lambda hidden, machine: _beginning(
        *({"coefficient_n_m": part * hidden.ploughing_n_m} for part in (0.1, 0.3, 1.0))
    ),
    "gyroscopic_coupling": lambda hidden, machine: _beginning({"share": hidden.gyroscopic}),
    "thermal_preload": lambda hidden, machine: _beginning(
        {"rise": hidden.thermal_rise, "exponent": 1.7}, {"rise": 0.6 * hidden.thermal_rise, "exponent": 1.2}
    ),
    "ring_expansion": _ring,
    "holder_joint": _joint,
    "housing_compliance": _housing,
    "workpiece_mode": _workpiece,
    "cutting_speed_coefficient": lambda hidden, machine: _beginning(
        *({"exponent": part * hidden.speed_softening} for part in (0.3, 0.6, 1.0))
    ),
    "chip_thickness_power_law": lambda hidden, machine: _beginning(*({"exponent": one} for one in (0.9, 0.75, 0.5))),
    "speed_dependent_damping": _damping,
    "directional_asymmetry": _asymmetry,
    "tool_runout": lambda hidden, machine: _beginning(
        *({"runout_um": 2e6 * hidden.runout_m, "phase_deg": phase} for phase in PHASES)
    ),
    "variable_pitch": _pitch,
    "radial_immersion_error": _immersion,
    "drawbar_stiffness": _drawbar,
}


def true_nuisances(shop: Shop) -> Values:
    """Return what the papers of a machine get wrong: logarithms of factors, by the names of nuisances."""
    true, said = shop.truth, shop.papers
    pairs = {
        "specific_cutting_energy": (true.cutting.kt_pa, said.cutting.kt_pa),
        "kn": (true.cutting.kn, said.cutting.kn),
        "preload": (true.preload_n, said.preload_n),
        "shaft_stiffness": (true.sections[0].material.modulus_pa, said.sections[0].material.modulus_pa),
        "damping": (true.damping.ratio or true.damping.stiffness_s, said.damping.ratio or said.damping.stiffness_s),
    }
    return {name: math.log(one / other) for name, (one, other) in pairs.items()}


def held_against(root: Path, seed: int) -> dict[str, Any]:
    """Return how high the search for the hidden effect of a seed comes, and how high fits from the truth [nats]."""
    shop = draw_shop(seed)
    (name,) = shop.plan.effects
    with threadpool_limits(1):
        model = replace(base_model(read_campaign(root / "campaigns" / str(seed))), forgiving=True)
        comparison = Comparison(model=model)
        fit = calibrate(comparison, start=PRIORS.about(model).estimate)
        base = Hypothesis(candidates=(), comparison=comparison, fit=fit)
        variants = [one for one in candidates_of(model, Content()) if one.name == name]
        searched = _searched(base, variants)
        began = max(_from_truth(base, variants, shop))
    return {
        "seed": seed,
        "hidden": name,
        "strength": shop.plan.strengths[0],
        "searched_nats": searched.log_posterior - fit.log_posterior,
        "from_truth_nats": began - fit.log_posterior,
        "evidence_nats": searched.log_evidence - fit.log_evidence,
    }


def _searched(base: Hypothesis, variants: Sequence[Candidate]) -> Fit:
    nested = ground(base)
    near = [fit_hypothesis(base.comparison, [one], nested) for one in variants]
    return max((refit(one, one.fit).fit for one in near), key=lambda one: one.log_posterior)


def _from_truth(base: Hypothesis, variants: Sequence[Candidate], shop: Shop) -> Iterator[float]:
    """Yield the heights of fits from every beginning, with nuisances as they are and as the base model has them."""
    (name,) = shop.plan.effects
    beginning = BEGINNINGS[name](shop.hidden, shop.papers)
    fitted = dict(zip((p.name for p in base.fit.parameters), map(float, base.fit.estimate), strict=True))
    true = true_nuisances(shop)
    for variant in variants:
        if beginning.settings.items() <= variant.settings.items():
            comparison = extended(base.comparison, [variant])
            for values in beginning.values:
                own = {f"{name}.{key}": value for key, value in values.items()}
                for beside in (true, fitted):
                    start = start_at(comparison.parameters, beside | own)
                    yield maximise(
                        comparison, [start], free_parameters(comparison, (), start), 1, LEFT_GAIN
                    ).log_posterior


def start_at(parameters: Sequence[Parameter], values: Values) -> Array:
    """Return values (parameter,) by their names, within the bounds; at the null what is not named."""
    wanted = np.array([values.get(parameter.name, parameter.null) for parameter in parameters])
    return np.clip(wanted, column(parameters, "lower"), column(parameters, "upper"))


def keep(root: Path, seed: int) -> str:
    """Compute and keep the row of a seed; return it in words."""
    row = held_against(root, seed)
    keep_row(root, TABLE, seed, row)
    return f"searched {row['searched_nats']:+.1f}, from the truth {row['from_truth_nats']:+.1f} nats"


def table(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return the lines of a table, what the search misses most first."""
    header = ["seed", "hidden", "strength", "search [nats]", "from the truth [nats]", "missed"]
    missed = sorted(rows, key=lambda row: row["searched_nats"] - row["from_truth_nats"])
    told = []
    for row in missed:
        searched, began = row["searched_nats"], row["from_truth_nats"]
        cells = [f"{row['strength']:.2f}", f"{searched:.1f}", f"{began:.1f}", f"{max(began - searched, 0.0):.1f}"]
        told.append([str(row["seed"]), row["hidden"], *cells])
    return markdown(header, told)


def main() -> int:
    """Print the table; return 1 where a campaign is not there or hides something else than one effect."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.blind.from_truth", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("seeds", type=int, nargs="+", help="that hide one effect")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="seeds at once")
    said = parser.parse_args()
    root: Path = said.folder
    absent = [seed for seed in said.seeds if not (root / "campaigns" / str(seed) / "stability.csv").exists()]
    others = [seed for seed in said.seeds if plan(seed).kind != "one"]
    if others:
        print(f"{', '.join(map(str, others))}: of no campaign that hides one effect with a name")
        return 1
    if absent:
        print(f"{root}/campaigns: no campaign of seed {', '.join(map(str, absent))}")
        return 1
    rows = kept_rows(keep, [(root, seed) for seed in said.seeds], TABLE, said.workers)
    write_rows(root / f"{TABLE}.csv", rows)
    print("\n".join(table(rows)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
