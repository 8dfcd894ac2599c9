"""Intervals of an effect's parameters, and a fit that no profile of theirs ends above."""

from collections.abc import Sequence
from functools import partial

from chatter_core.evidence.assessment import Ended, Limits
from chatter_core.evidence.candidates import Hypothesis
from chatter_core.evidence.intervals import HigherPlace
from chatter_core.evidence.pursuit import refit_from
from pipeline.cluster import Workers
from pipeline.jobs import Job, spread
from pipeline.pieces import interval_jobs, intervals


def profiled(workers: Workers | None, named: Hypothesis) -> tuple[Hypothesis, dict[str, Limits]]:
    """Return a hypothesis and the intervals of its effects' parameters; none of a base model.

    Where a profile ends above the fit, that was no maximum: it is fitted again from there, and profiled once more.
    """
    names = own_parameters(named)
    if not names:
        return named, {}
    ends = _ends(workers, named, names)
    if (higher := highest(ends)) is not None:
        named = fitted_from(workers, named, higher)
        ends = _ends(workers, named, names)
    return named, intervals(named.fit, names, ends)


def highest(ends: Sequence[Ended]) -> HigherPlace | None:
    """Return the highest place that profiles have come upon above their fit, None where it was a maximum."""
    return max((one for one in ends if isinstance(one, HigherPlace)), key=lambda one: one.rise, default=None)


def fitted_from(workers: Workers | None, hypothesis: Hypothesis, place: HigherPlace) -> Hypothesis:
    """Return a hypothesis that is fitted again from a higher place."""
    again = partial(refit_from, hypothesis, place.values)
    name = f"{hypothesis.name or 'calibration'}, from a higher place"
    found: list[Hypothesis] = spread(workers, [Job(name=name, call=again)])
    return found[0]


def own_parameters(named: Hypothesis) -> list[str]:
    """Return the names of the parameters of a hypothesis' effects."""
    return [parameter.name for candidate in named.candidates for parameter in candidate.term.parameters]


def _ends(workers: Workers | None, named: Hypothesis, names: list[str]) -> list[Ended]:
    return spread(workers, interval_jobs(named.comparison, named.fit, names))
