"""Where a model fails by more than noise explains, in words: by speed, depth, mode, direction, time and frequency."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from chatter_core.evidence import likelihood
from chatter_core.evidence.bands import LEAST_CHANCE, Band, conspicuous_bands
from chatter_core.evidence.campaign import Campaign
from chatter_core.evidence.columns import NO_WORD
from chatter_core.evidence.comparison import Compared
from chatter_core.evidence.fit import Fit
from chatter_core.evidence.margin import LIMIT_REACH, out_of_reach
from chatter_core.evidence.measured import DIRECTIONS, OUTCOMES, Trials
from chatter_core.evidence.measured_rows import rows_of
from chatter_core.evidence.nuisances import TYPICAL_MARGINAL_WIDTH, TYPICAL_MISLABELLED, TYPICAL_OUTCOME_WIDTH, Nuisance
from chatter_core.evidence.parameters import Array
from chatter_core.evidence.prediction import CampaignModel, Prediction
from chatter_core.evidence.receptance_bands import Misfit, misfits
from chatter_core.stability import TOO_SLOW
from chatter_core.units import si_factor

#: A datum has failed when it is so improbable, to both sides together.
IMPROBABLE = 0.05
#: A band with more than this share of the data is no particular place.
MOST_OF_ALL = 0.8
#: No smaller chance is written down.
LEAST_TOLD = 1e-99
#: A pull beyond this many prior widths is a finding by itself.
LARGEST_PULL = 3.0
#: Labels that err more than is typical may hide what the model lacks; that they err less says nothing of it.
NOISE_OF_LABELS = ("mislabelled", "outcome_width", "marginal_width")


@dataclass(frozen=True, kw_only=True)
class Failure:
    """A place where a model fails, or one of which it can be told only that no model could be judged there.

    quantity: what is told wrongly; band: where, by the keys of the tables, with low and high or one value;
    excess: share of the data there that fail beyond what noise explains, for a receptance that of its norm,
    for a pull its widths beyond what is plausible; chance: that a right model looks like this; text; counts: whether it
    says anything against the model.
    """

    quantity: str
    band: dict[str, object]
    excess: float
    chance: float
    text: str
    counts: bool = True


@dataclass(frozen=True, kw_only=True)
class _Data:
    """Data of one quantity that can fail in one way.

    which: their rows in the table; failed, probability: (datum,) as a right model has them; what: the data
    in words, and done: what those that failed did; hence: what that says, "" for nothing more.
    """

    quantity: str
    which: NDArray[np.intp]
    failed: NDArray[np.bool_]
    probability: Array
    what: str
    done: str
    hence: str = ""


def failures(
    model: CampaignModel, compared: Compared, dominant_mode: Array, fit: Fit | None, curve: Sequence[str] = ()
) -> list[Failure]:
    """Return where a model fails, the least probable by chance first, and at last the cuts that cannot be judged.

    dominant_mode: (trial,) number of the mode that chatters, as the model has it, 0 where unknown; fit: the
    calibration, None for a model as described; curve: names of its parameters that describe nothing, of which none
    goes too far.

    See docs/physics.md#comparison.
    """
    campaign, unresolved = model.campaign, model.unresolved(compared.prediction)
    found = [*_of_trials(campaign, compared, dominant_mode, fit, unresolved)]
    found += [*_of_tables(campaign, compared, unresolved), *_of_unresolved(campaign, unresolved)]
    found += _without_limit(campaign, compared)
    found += _of_responses(campaign, compared.prediction)
    found += _of_pulls(fit, curve) if fit is not None else []
    return sorted(found, key=lambda failure: (failure.chance, -failure.excess))


def but_for_effects(found: Sequence[Failure], model: CampaignModel, fit: Fit) -> list[Failure]:
    """Return failures but for how large a model's effects are within their bounds.

    Their priors say what is usual, and the evidence has counted already how unusual they are.

    See docs/physics.md#diagnosis.
    """
    at_bound = {p.name for p, stands in zip(fit.parameters, fit.at_bound, strict=True) if stands}
    of_effects = {p.name for term in model.terms if not isinstance(term, Nuisance) for p in term.parameters}
    return [failure for failure in found if failure.band.get("parameter") not in of_effects - at_bound]


def _of_trials(
    campaign: Campaign, compared: Compared, dominant_mode: Array, fit: Fit | None, unresolved: NDArray[np.bool_]
) -> Iterator[Failure]:
    trials = campaign.trials
    if trials is None:
        return
    places, judged = _places(campaign, trials, dominant_mode), ~unresolved[: len(trials)]
    for data in [*_labels(trials, compared, fit), *_frequencies(trials, compared, judged)]:
        for key, (place, unit) in places.items():
            yield from _bands(data, key, place, unit)
    lost = int((np.isnan(compared.prediction.margin) & judged).sum())
    if lost:
        # As many could have a wrong label, which no model tells.
        wrong = TYPICAL_MISLABELLED * _more_noise(fit)["mislabelled"]
        chance = float(scipy.stats.binom.sf(lost - 1, judged.sum(), wrong))
        text = f"The model has no answer for {lost} of {len(trials)} cuts; they count as told wrongly."
        yield Failure(quantity="outcome", band={}, excess=lost / len(trials), chance=chance, text=text)


def _places(campaign: Campaign, trials: Trials, dominant_mode: Array) -> dict[str, tuple[Array, str]]:
    """Return where trials lie: key of the table -> values (trial,) in its unit, and the unit in words.

    What a trial does not state is the machine's own.
    """
    process, spindle = campaign.machine.process, campaign.machine.spindle
    preload = trials.preload if spindle is None else _stated(trials.preload, spindle.preload)
    feed = _stated(trials.feed_per_tooth, process.feed_per_tooth)
    own = DIRECTIONS.index(process.direction)
    return {
        "spindle_speed_rpm": (trials.spindle_speed / si_factor("spindle_speed_rpm"), "rpm"),
        "axial_depth_mm": (trials.axial_depth / si_factor("axial_depth_mm"), "mm"),
        "trial": (trials.trial.astype(float), ""),
        "preload_n": (preload, "N"),
        "radial_immersion": (_stated(trials.radial_immersion, process.radial_immersion), ""),
        "feed_per_tooth_mm": (feed / si_factor("feed_per_tooth_mm"), "mm"),
        "direction": (np.where(trials.direction == NO_WORD, own, trials.direction).astype(float), ""),
        "dominant_mode": (np.where(dominant_mode > 0, dominant_mode, np.nan), ""),
    }


def _stated(values: Array, own: float) -> Array:
    return np.where(np.isnan(values), own, values)


def _labels(trials: Trials, compared: Compared, fit: Fit | None) -> Iterator[_Data]:
    """Yield cuts that should chatter and did not, and those that should be stable; by the noise that is plausible."""
    margin, more = compared.prediction.margin, _more_noise(fit)
    marginal = (trials.outcome == OUTCOMES.index("marginal")).any()
    probability = likelihood.outcome_probabilities(
        margin,
        mislabelled=TYPICAL_MISLABELLED * more["mislabelled"],
        width=TYPICAL_OUTCOME_WIDTH * more["outcome_width"],
        marginal_width=TYPICAL_MARGINAL_WIDTH * more["marginal_width"] if marginal else None,
    )
    stable, chatter = probability[:, 0], probability[:, -1]
    # Above an island or inside of one the nearest boundary does not lie where a single limit would.
    assert compared.prediction.cuts is not None
    islands = margin * compared.prediction.cuts.crossing[: len(margin)] > 0.0
    told = trials.outcome != OUTCOMES.index("marginal")
    for should, label, of_label, what, done, hence in (
        (margin > 0.0, "stable", stable, "that should chatter", "stable", "the boundary lies deeper there"),
        (margin <= 0.0, "chatter", chatter, "that should be stable", "chattered", "the boundary lies less deep there"),
    ):
        which = np.flatnonzero(should & told)
        failed = trials.outcome[which] == OUTCOMES.index(label)
        yield _Data(
            quantity="outcome",
            which=which,
            failed=failed,
            probability=(of_label / (stable + chatter))[which],
            what=f"cuts {what}",
            done="were stable" if done == "stable" else done,
            hence="" if islands[which][failed].any() else hence,
        )


def _more_noise(fit: Fit | None) -> dict[str, float]:
    """Return by how much more labels err than is typical: as fitted, by one width of the prior at most.

    With all that a fit takes for noise nothing would be left that fails.
    """
    more = dict.fromkeys(NOISE_OF_LABELS, 1.0)
    if fit is not None:
        for parameter, estimate in zip(fit.parameters, fit.estimate, strict=True):
            if parameter.name in more:
                more[parameter.name] = float(np.exp(np.clip(estimate, 0.0, parameter.prior_width)))
    return more


def _frequencies(trials: Trials, compared: Compared, judged: NDArray[np.bool_]) -> Iterator[_Data]:
    """Yield the chatter frequencies that are farther off than one in twenty is, of the trials (trial,) to judge by."""
    heard = np.isfinite(trials.chatter_frequency) & judged
    which = np.flatnonzero(heard)
    if not len(which) or not len(compared.prediction.chatter_frequency):
        return
    measured = trials.chatter_frequency[which]
    frequency, share, tooth_passing = compared.prediction.motions(heard)
    residual = likelihood.to_lines(measured[:, None], frequency, tooth_passing[:, None])
    scale = likelihood.frequency_scale(measured, compared.prediction.margin[which])
    apart = np.abs(likelihood.heard_motion(residual, share, scale, tooth_passing)[0])
    far = scipy.stats.t.ppf(1.0 - 0.5 * IMPROBABLE, likelihood.FREQUENCY_FREEDOM) * scale
    yield _Data(
        quantity="chatter_frequency",
        which=which,
        failed=apart > far,
        probability=likelihood.chance_beyond(far, residual, share, scale, tooth_passing),
        what="chatter frequencies",
        done=f"are off by more than noise ({np.median(far) / si_factor('frequency_hz'):.0f} Hz or so)",
    )


def _without_limit(campaign: Campaign, compared: Compared) -> Iterator[Failure]:
    """Yield that measured limiting depths have none of the model's anywhere near."""
    count = int(out_of_reach(compared.prediction.limit_margin).sum())
    if campaign.limits is None or not count:
        return
    factor, rows = np.exp(LIMIT_REACH), len(campaign.limits)
    text = (
        f"From {1.0 / factor:.2g} to {factor:.2g} times the measured limiting depth the model has no limit for {count} "
        f"of {rows}; they count as off by that factor, at least."
    )
    yield Failure(quantity="limit_depth", band={}, excess=count / rows, chance=0.0, text=text)


def _of_unresolved(campaign: Campaign, unresolved: NDArray[np.bool_]) -> Iterator[Failure]:
    """Yield how many cuts turn too slowly for any model."""
    trials = 0 if campaign.trials is None else len(campaign.trials)
    for quantity, table, which, what in (
        ("outcome", campaign.trials, unresolved[:trials], "cuts"),
        ("limit_depth", campaign.limits, unresolved[trials:], "measured limiting depths"),
    ):
        if table is None or not which.any():
            continue
        speed = table.spindle_speed[which] / si_factor("spindle_speed_rpm")
        text = (
            f"{which.sum()} of {len(which)} {what} say nothing, for none can be computed there, the first at "
            f"{speed[0]:.4g} rpm: {TOO_SLOW}."
        )
        band: dict[str, object] = {"spindle_speed_rpm": [float(speed.min()), float(speed.max())]}
        yield Failure(quantity=quantity, band=band, excess=0.0, chance=1.0, text=text, counts=False)


def _of_tables(campaign: Campaign, compared: Compared, unresolved: NDArray[np.bool_]) -> Iterator[Failure]:
    """Yield where limiting depths, modes and stiffnesses are off to one side over speed, and what has no answer."""
    for table in rows_of(campaign, compared.prediction, ~unresolved):
        if table.quantity not in compared.contributions or not len(table.apart):
            continue
        known = np.flatnonzero(np.isfinite(table.apart))
        lost = len(table.apart) - len(known)
        if lost:
            text = (
                f"The model has no answer for {lost} of {len(table.apart)} measured {table.what}; they count as wrong."
            )
            yield Failure(quantity=table.quantity, band={}, excess=lost / len(table.apart), chance=0.0, text=text)
        # Limit depths are of Student's law, and all else of the normal one, which is that of infinite freedom.
        freedom = likelihood.LIMIT_FREEDOM if table.quantity == "limit_depth" else np.inf
        standard, far = (table.apart / table.error)[known], scipy.stats.t.ppf(1.0 - 0.5 * IMPROBABLE, freedom)
        for failed, side in ((standard > far, "larger"), (standard < -far, "smaller")):
            data = _Data(
                quantity=table.quantity,
                which=known,
                failed=failed,
                probability=np.full(len(known), 0.5 * IMPROBABLE),
                what=f"measured {table.what}",
                done=f"are {side} than predicted by more than noise",
            )
            place = table.spindle_speed / si_factor("spindle_speed_rpm")
            yield from _bands(data, "spindle_speed_rpm", place, "rpm")


def _bands(data: _Data, key: str, place: Array, unit: str) -> Iterator[Failure]:
    """Yield the bands of a place in which data fail; those that lie nowhere are left out.

    Data that fail all over are told once, by their speeds.
    """
    at = place[data.which]
    known = np.isfinite(at)
    single = key in ("direction", "dominant_mode")
    for band in conspicuous_bands(at[known], data.failed[known], data.probability[known], single=single):
        if band.seen > MOST_OF_ALL * known.sum() and key != "spindle_speed_rpm":
            continue
        yield Failure(
            quantity=data.quantity,
            band={key: _value(key, band)},
            excess=(band.failed - band.expected) / band.seen,
            chance=band.chance,
            text=_sentence(data, band, _where(key, band, unit)),
        )


def _value(key: str, band: Band) -> object:
    if key == "direction":
        return DIRECTIONS[int(band.low)]
    return int(band.low) if key == "dominant_mode" else [band.low, band.high]


def _where(key: str, band: Band, unit: str) -> str:
    """Return the band in words."""
    if key == "direction":
        return f"in {DIRECTIONS[int(band.low)]} milling"
    if key == "dominant_mode":
        return f"where mode {band.low:.0f} chatters"
    if key == "trial":
        return f"from trial {band.low:.0f} to {band.high:.0f}"
    name = {"preload_n": "preloads", "radial_immersion": "immersions", "feed_per_tooth_mm": "feeds"}.get(key)
    many = f"{band.low:.5g} to {band.high:.5g}" if band.low < band.high else f"{band.low:.5g}"
    return f"at {name + ' of ' if name else ''}{many}{' ' + unit if unit else ''}"


def _sentence(data: _Data, band: Band, where: str) -> str:
    hence = f": {data.hence}" if data.hence else ""
    at_most = max(min(band.chance, LEAST_CHANCE), LEAST_TOLD)
    chance = f"{band.chance:.1g}" if band.chance > LEAST_CHANCE else f"{at_most:.1g} at most"
    return (
        f"Of {band.seen} {data.what} {where}, {band.failed} {data.done}; noise explains {band.expected:.1f} "
        f"(chance {chance}){hence}."
    )


def _of_responses(campaign: Campaign, prediction: Prediction) -> Iterator[Failure]:
    """Yield the bands in which responses differ by more than noise, and responses that have no answer."""
    if not campaign.receptances:
        return
    yield from (_of_misfit(misfit) for misfit in misfits(campaign, prediction))
    for measured, lost in zip(campaign.receptances, prediction.lost, strict=True):
        if lost:
            text = f"The model has no answer for receptance {measured}; it counts as wrong."
            yield Failure(quantity="receptance", band={"receptance": str(measured)}, excess=1.0, chance=0.0, text=text)


def _of_misfit(misfit: Misfit) -> Failure:
    return Failure(
        quantity="receptance",
        band={
            "receptance": misfit.response,
            "frequency_hz": [misfit.low, misfit.high],
            **({"mode": misfit.mode} if misfit.mode else {}),
        },
        excess=misfit.apart - misfit.expected,
        chance=misfit.chance,
        text=misfit.text,
    )


def _of_pulls(fit: Fit, curve: Sequence[str]) -> Iterator[Failure]:
    """Yield the parameters that had to go farther than a data sheet or a sensor plausibly errs.

    Of many that are looked at one goes far by chance: it counts for as many as there are of its kind.
    """
    alike = Counter(parameter.touches for parameter in fit.parameters if parameter.name not in curve)
    for parameter, estimate, pull in zip(fit.parameters, fit.estimate, fit.pull, strict=True):
        no_finding = parameter.name in curve or (parameter.name in NOISE_OF_LABELS and pull < 0.0)
        if abs(pull) > LARGEST_PULL and not no_finding:
            moved = (
                f"a factor of {np.exp(estimate):.3g}" if parameter.unit == "ln" else f"{estimate:.3g} {parameter.unit}"
            )
            yield Failure(
                quantity="calibration",
                band={"parameter": parameter.name},
                excess=float(abs(pull) - LARGEST_PULL),
                chance=min(1.0, alike[parameter.touches] * float(2.0 * scipy.stats.norm.sf(abs(pull)))),
                text=f"The fit needs {moved} on {parameter.name}, {abs(pull):.1f} times what is plausible "
                f"({parameter.doc}): either it was stated very wrongly, or it stands in for something that the "
                "model lacks.",
            )
