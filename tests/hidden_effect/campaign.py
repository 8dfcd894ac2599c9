"""A campaign from a seed: a machine, what it hides, the cuts of a shop, and the truth apart from them."""

import csv
import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np
import yaml

from tests.hidden_effect.ball_bearing import NoEquilibrium
from tests.hidden_effect.design import Plan, plan
from tests.hidden_effect.drawing import draw_machine, true_machine
from tests.hidden_effect.effects import FOREIGN, LATER, NAMED, prepared
from tests.hidden_effect.hidden import Hidden, thermal_history
from tests.hidden_effect.machine import Machine, described
from tests.hidden_effect.measure import Row, Scheme, bearing_rows, draw_scheme, mode_rows, receptance, receptance_rows
from tests.hidden_effect.structure import Spindle
from tests.hidden_effect.trial import Condition, Result, cut_trial

Generator = np.random.Generator

#: Share of wrong labels, of chatter without a frequency, of trials that are kept back; error of a frequency.
MISLABELLED, UNHEARD, KEPT_BACK, FREQUENCY_ERROR = 0.03, 0.15, 0.30, 0.002
SPEEDS = (18, 22)
LOWEST_RPM = 2600.0
#: A machine is worth a campaign when its least expected limit lies between these, [m] and over the tool's diameter,
#: and when it chatters at the deepest cut, over the diameter, at all speeds that are looked up but so many.
LEAST_LIMIT_M, MOST_LIMIT, DEEPEST, NEVER_CHATTERS = 0.15e-3, 0.25, 0.8, 2
#: Modes that a model of the machine is expected to have, and the largest resonance beyond them over the largest of
#: all: where there is more, modes that are left out would be an effect of their own.
MODEL_MODES, BEYOND = 4, 0.06
#: Share of the shops that cut slowly (where flanks rub: of most of those), and their highest speed over the machine's.
SLOW, SLOW_WHERE_FLANKS_RUB, SLOW_SHARE = 0.2, 0.7, 0.55
#: Speeds at which the shop looks up what its papers promise, first depth [m] and the ratio of the search.
LOOKED_UP, FIRST_DEPTH, SEARCH_RATIO = 7, 0.1e-3, 1.35
#: File of the truth that says that all is written.
SEAL = "seal.sha256"
#: Machines that are drawn before a seed is given up.
MOST_DRAWS = 40


@dataclass(frozen=True, kw_only=True)
class Shop:
    """A drawn campaign before the first cut; ladder: first depth [m] and ratio of depths."""

    plan: Plan
    papers: Machine
    truth: Machine
    hidden: Hidden
    scheme: Scheme
    highest_rpm: float
    ladder: tuple[float, float]


def hide(plan: Plan, machine: Machine, rng: Generator) -> Hidden:
    """Draw the parameters of the planned effects for a machine."""
    laws = NAMED | FOREIGN
    for later in LATER[: plan.generation]:
        laws |= later
    drawn: dict[str, object] = {}
    for name, strength in zip(plan.effects, plan.strengths, strict=True):
        drawn |= laws[name](strength, rng, machine)
    return Hidden(**drawn)


def draw_shop(seed: int, *, errors: float = 1.0) -> Shop:
    """Draw machines until one is worth a campaign; ``errors`` scales what its papers get wrong.

    Raises ValueError when none is.
    """
    planned = plan(seed)
    for attempt in range(MOST_DRAWS):
        shop = _drawn_shop(planned, np.random.default_rng([seed, 10, attempt]), errors)
        if shop is not None:
            return shop
    raise ValueError(f"seed {seed}: none of {MOST_DRAWS} machines is worth a campaign")


def _drawn_shop(planned: Plan, rng: Generator, errors: float) -> Shop | None:
    """Draw a shop; None where its machine is not worth a campaign."""
    papers, highest = draw_machine(rng)
    slow = SLOW_WHERE_FLANKS_RUB if "process_damping" in planned.effects else SLOW
    if rng.random() < slow:
        highest = round(SLOW_SHARE * highest, -2)
    for name, strength in zip(planned.effects, planned.strengths, strict=True):
        papers = prepared(papers, name, strength)
    truth = true_machine(rng, papers, errors)
    hidden = hide(planned, papers, rng)
    try:
        if resonance_beyond(papers, highest) > BEYOND:
            return None
        limits = expected_limits(papers, highest)
        for effects in (hidden, Hidden()):
            Spindle(truth, effects).tip(highest * math.pi / 30.0)
    except NoEquilibrium:
        return None
    if not is_worth_it(papers, limits):
        return None
    first, top = 0.5 * min(limits), 1.3 * max(limits)
    return Shop(
        plan=planned,
        papers=papers,
        truth=truth,
        hidden=hidden,
        scheme=draw_scheme(rng, highest, planned.effects),
        highest_rpm=highest,
        ladder=(first, float(np.clip((top / first) ** (1.0 / 6.0), 1.35, 1.65))),
    )


def resonance_beyond(papers: Machine, highest_rpm: float) -> float:
    """Return the largest resonance above the modes that a model has, over the largest of all; at rest or fast."""
    spindle, shares = Spindle(papers, Hidden()), []
    for speed in (0.0, highest_rpm * math.pi / 30.0):
        tip = spindle.tip(speed)
        of_x = np.flatnonzero(tip.output[:, 0])
        of_x = of_x[np.argsort(np.abs(tip.eigenvalue[of_x]))]
        peak = np.abs(tip.input[of_x, 0] * tip.output[of_x, 0] / tip.eigenvalue[of_x].real)
        shares.append(float(peak[MODEL_MODES:].max() / peak.max()))
    return max(shares)


def is_worth_it(papers: Machine, limits: list[float]) -> bool:
    """Return whether a shop would find both stable cuts and chatter at most speeds."""
    diameter = papers.tool.diameter_m
    never = sum(limit >= DEEPEST * diameter for limit in limits)
    return LEAST_LIMIT_M <= min(limits) <= MOST_LIMIT * diameter and never <= NEVER_CHATTERS


def expected_limits(papers: Machine, highest_rpm: float) -> list[float]:
    """Return the depths [m] at which the machine of the papers begins to chatter, at a few speeds."""
    spindle, limits = Spindle(papers, Hidden()), []
    for rpm in np.geomspace(1.1 * LOWEST_RPM, highest_rpm, LOOKED_UP):
        depth = FIRST_DEPTH
        while depth < DEEPEST * papers.tool.diameter_m and _usual(spindle, float(rpm), depth).outcome == "stable":
            depth *= SEARCH_RATIO
        limits.append(depth)
    return limits


def _usual(spindle: Spindle, rpm: float, depth: float) -> Result:
    process = spindle.machine.process
    condition = Condition(
        order=0,
        speed_rpm=rpm,
        depth_m=depth,
        feed_per_tooth_m=process.feed_per_tooth_m,
        radial_immersion=process.radial_immersion,
        direction=process.direction,
    )
    return cut_trial(spindle, condition)


def _speeds(rng: Generator, highest: float) -> list[float]:
    """Return speeds [rpm], spread evenly with some chance, in the order in which they are cut."""
    count = int(rng.integers(SPEEDS[0], SPEEDS[1] + 1))
    edges = np.linspace(LOWEST_RPM, highest, count + 1)
    drawn = np.round(rng.uniform(edges[:-1], edges[1:]), -1)
    return [float(rpm) for rpm in rng.permutation(drawn)]


def cut_all(shop: Shop, rng: Generator) -> tuple[list[Condition], list[Result]]:
    """Cut as a shop does: at each speed deeper and deeper until it chatters, once between, once beyond."""
    spindle = Spindle(shop.truth, shop.hidden)
    conditions: list[Condition] = []
    results: list[Result] = []
    deepest = DEEPEST * shop.papers.tool.diameter_m

    def cut(condition: Condition) -> str:
        conditions.append(condition)
        factor = thermal_history(shop.hidden, [one.speed_rpm * math.pi / 30.0 for one in conditions])[-1]
        results.append(cut_trial(spindle, condition, factor))
        return results[-1].outcome

    for rpm in _speeds(rng, shop.highest_rpm):
        usual = _usual_condition(shop, rng, rpm)
        first, ratio = shop.ladder
        depth = before = first * float(rng.uniform(0.9, 1.1))
        while depth <= deepest:
            rounded = replace(usual, order=len(conditions), depth_m=_rounded(depth))
            if cut(rounded) == "chatter":
                for more in (math.sqrt(before * depth), depth * ratio):
                    cut(replace(usual, order=len(conditions), depth_m=_rounded(more)))
                break
            before, depth = depth, depth * ratio
    return conditions, results


def _rounded(depth: float) -> float:
    return round(depth, 6)


def _usual_condition(shop: Shop, rng: Generator, rpm: float) -> Condition:
    """Return the cut at a speed, with feed and immersion of its own where the shop varies them."""
    process = shop.papers.process
    feed, immersion = process.feed_per_tooth_m, process.radial_immersion
    if shop.scheme.feeds:
        feed = round(feed * float(rng.choice([0.4, 1.0, 1.8])), 5)
    if shop.scheme.immersions and process.direction != "slot":
        immersion = round(immersion * float(rng.choice([0.6, 1.0, 1.4])), 3)
    return Condition(
        order=0,
        speed_rpm=rpm,
        depth_m=0.0,
        feed_per_tooth_m=feed,
        radial_immersion=min(immersion, 1.0),
        direction=process.direction,
    )


def trial_rows(
    shop: Shop, conditions: Sequence[Condition], results: Sequence[Result], rng: Generator | None
) -> list[Row]:
    """Write trials down; with ``rng`` as a shop does: some labels wrong, some frequencies missing, none exact."""
    rows: list[Row] = []
    for condition, result in zip(conditions, results, strict=True):
        judged, frequency = result.outcome, result.chatter_frequency_hz
        if rng is not None:
            wrong, unheard, error = rng.random(), rng.random(), rng.standard_normal()
            frequency = math.nan if unheard < UNHEARD else frequency * (1.0 + FREQUENCY_ERROR * error)
            if wrong < MISLABELLED:
                judged, frequency = ("stable" if judged == "chatter" else "chatter"), math.nan
        row: Row = {
            "trial": condition.order + 1,
            "spindle_speed_rpm": f"{condition.speed_rpm:.1f}",
            "axial_depth_mm": f"{condition.depth_m * 1e3:.3f}",
            "outcome": judged,
            "chatter_frequency_hz": "" if math.isnan(frequency) else f"{frequency:.1f}",
        }
        if shop.scheme.feeds:
            row["feed_per_tooth_mm"] = f"{condition.feed_per_tooth_m * 1e3:.5g}"
        if shop.scheme.immersions:
            row["radial_immersion"] = f"{condition.radial_immersion:.5g}"
        rows.append(row)
    return rows


def make_campaign(seed: int, folder: Path, truth_folder: Path, *, errors: float = 1.0) -> None:
    """Write the campaign of a seed, and its truth into a folder of its own, which a diagnosis must not see.

    The truth ends with ``seal.sha256``, the digests of all files of both folders: where it stands, all is written.
    """
    shop = draw_shop(seed, errors=errors)
    rng = np.random.default_rng([seed, 20])
    conditions, results = cut_all(shop, rng)
    kept_back = rng.random(len(conditions)) < KEPT_BACK
    spindle = Spindle(shop.truth, shop.hidden)
    tables = {
        "stability.csv": [
            row for row, back in zip(trial_rows(shop, conditions, results, rng), kept_back, strict=True) if not back
        ],
        "frf.csv": receptance_rows(spindle, shop.scheme, rng),
        "modes.csv": mode_rows(spindle, shop.scheme, rng),
        "bearing.csv": bearing_rows(spindle, shop.papers.preload_n, shop.scheme, rng),
    }
    clean = trial_rows(shop, conditions, results, None)
    for stale in (*folder.glob("*.csv"), truth_folder / SEAL):
        stale.unlink(missing_ok=True)
    folder.mkdir(parents=True, exist_ok=True)
    truth_folder.mkdir(parents=True, exist_ok=True)
    (folder / "machine.yaml").write_text(yaml.safe_dump(described(shop.papers), sort_keys=False))
    for name, rows in tables.items():
        if rows:
            _write_table(folder / name, rows)
    _write_table(truth_folder / "stability_test.csv", [row for row, back in zip(clean, kept_back, strict=True) if back])
    truth = truth_of(seed, shop, conditions, results)
    (truth_folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
    write_seal(folder, truth_folder)


def _write_table(path: Path, rows: list[Row]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def digests(folder: Path, truth_folder: Path) -> str:
    """Return the digests of a campaign's files and of its truth's, a line each."""
    files = [*sorted(folder.iterdir()), truth_folder / "stability_test.csv", truth_folder / "truth.json"]
    return "".join(f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.name}\n" for file in files)


def write_seal(folder: Path, truth_folder: Path) -> None:
    """Write the seal, last of all and at once."""
    draft = truth_folder / "seal.draft"
    draft.write_text(digests(folder, truth_folder))
    draft.replace(truth_folder / SEAL)


def is_sealed(folder: Path, truth_folder: Path) -> bool:
    """Return whether a campaign is complete and as it was when it was made."""
    seal = truth_folder / SEAL
    return seal.exists() and folder.is_dir() and seal.read_text() == digests(folder, truth_folder)


def truth_of(seed: int, shop: Shop, conditions: Sequence[Condition], results: Sequence[Result]) -> dict[str, object]:
    """Return what ``truth.json`` holds: what is hidden, the true machine, and how much of it shows.

    label_flips: share of the trials that would end otherwise without the effect; receptance_change: largest change of
    the receptance over its largest value, at rest and at the highest speed.
    """
    foreign = shop.plan.kind == "foreign"
    verdict = {"none": "none", "one": "effect", "two": "effect", "foreign": "unexplained"}[shop.plan.kind]
    null = Hidden()
    plain = Spindle(shop.truth, null)
    without = results if shop.hidden == null else [cut_trial(plain, condition) for condition in conditions]
    hidden = Spindle(shop.truth, shop.hidden)
    changes = []
    for rpm in (0.0, shop.highest_rpm):
        before, after = receptance(plain, rpm), receptance(hidden, rpm)
        changes.append(float(np.abs(after - before).max() / np.abs(before).max()))
    shares = {
        name: sum(one.outcome == name for one in results) / len(results) for name in ("stable", "marginal", "chatter")
    }
    return {
        "seed": seed,
        "kind": shop.plan.kind,
        "verdict": verdict,
        "effect_names": [] if foreign else list(shop.plan.effects),
        "foreign": list(shop.plan.effects) if foreign else [],
        "strengths": list(shop.plan.strengths),
        "hidden": {
            field.name: _plain(getattr(shop.hidden, field.name))
            for field in fields(Hidden)
            if getattr(shop.hidden, field.name) != getattr(null, field.name)
        },
        "machine": asdict(shop.truth),
        "trials": len(conditions),
        "shares": shares,
        "label_flips": sum(
            (one.outcome == "chatter") != (other.outcome == "chatter")
            for one, other in zip(results, without, strict=True)
        )
        / len(results),
        "receptance_change": {"at_rest": changes[0], "at_highest_speed": changes[1]},
    }


def _plain(value: object) -> object:
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return value if isinstance(value, int | float) else asdict(value)
