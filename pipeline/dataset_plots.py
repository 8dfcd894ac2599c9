"""The plots of a data set's page: limit depths over speed cut by cut, against every input, and what they depend on."""

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from bokeh.models import Model
from bokeh.plotting import figure

from pipeline.best_cut_plots import KNOWN, RATE, SPEED, add_best_cut
from pipeline.by_value import by_value
from pipeline.dataset_figures import BANDS, MOST_INPUTS, SHOWN
from pipeline.dataset_tables import LOWEST, MOST_NAMED, limit_or_deepest, numbered, quantiles, removal_factors
from pipeline.dataset_tables import RATE as BEST_RATE
from pipeline.figures import COLOURS
from pipeline.page import cell
from pipeline.plots import WIDE, Choices, add_key, hover, numbers, plot
from pipeline.sensitivity import KEY
from pipeline.settings import margins_of
from pipeline.value_plots import lines_by_value

#: Cuts that can be chosen, and points of a cloud: a page has to stay below some megabytes, the store holds all.
MOST_CHOSEN, MOST_POINTS = 200, 4000
SPEED_LABEL = "spindle speed [rpm]"


def dataset_plots(data: xr.Dataset, samples: pd.DataFrame, told: pd.DataFrame, text: str) -> dict[str, Model]:
    """Return choices and plots by name."""
    made = dict[str, Model]()
    values = by_value(data)
    for of, (plotted, choices, sliders) in {
        "limits": _limits(data, samples),
        **({"values": lines_by_value(data["spindle_speed"].values, values)} if values else {}),
        "inputs": _against_inputs(data, samples),
    }.items():
        choices.bind()
        made |= choices.named(of) | {f"{of}_{name}": slider for name, slider in sliders.items()}
        made[of] = plotted
    if not told.empty:
        made["sensitivity"] = _tornado(told, text)
    return made


def _limits(data: xr.Dataset, samples: pd.DataFrame) -> tuple[figure, Choices, dict[str, Model]]:
    """Return limit depths over speed, bands of all cuts, and the one that is chosen with its best cut; its choices."""
    speed, limit = data["spindle_speed"].values, limit_or_deepest(data)
    rows = np.unique(np.linspace(0, len(limit) - 1, min(MOST_CHOSEN, len(limit))).astype(int))
    names = {str(row): _name(data, samples.iloc[row]) for row in rows}
    choices = Choices({"cut": names}, {"cut": str(rows[0])}, width=WIDE)
    frequency = data["limit_chatter_frequency"].values.reshape(limit.shape)
    mode = data["limit_dominant_mode"].values.reshape(limit.shape)
    source = choices.source(
        {
            (str(row),): {
                "limit": numbers(limit[row]),
                "frequency": numbers(frequency[row]),
                "mode": mode[row],
                KNOWN: limit[row],
                RATE: factor * speed,
            }
            for row, factor in zip(rows, removal_factors(data, list(map(int, rows))), strict=True)
        },
        {SPEED: speed},
    )
    made = plot("Limit depth of the chosen cut, and of all", SPEED_LABEL, "limit depth [mm]", height=440)
    made.y_range.start = 0.0
    entries = dict[str, list[Any]]()
    if len(limit) > 2:
        for low, high in BANDS:
            below, above = map(numbers, quantiles(limit, (low, high)))
            entries[f"{low:.0%} to {high:.0%} of all"] = [
                made.varea(speed, below, above, fill_color=COLOURS[0], fill_alpha=0.18)
            ]
    line = made.line("speed", "limit", source=source, line_width=2, color=COLOURS[1])
    points = made.scatter("speed", "limit", source=source, size=3, color=COLOURS[1])
    rows_told = [
        ("spindle speed", "@speed{0} rpm"),
        ("limit depth", "@limit{0.000} mm"),
        ("chatter frequency", "@frequency{0} Hz"),
        ("mode", "@mode"),
    ]
    made.add_tools(hover([points], rows_told))
    mark, sliders = add_best_cut(made, source, margins_of(data.attrs))
    add_key(made, {"chosen cut": [line, points], "best cut": [mark], **entries})
    return made, choices, sliders


def _name(data: xr.Dataset, sample: pd.Series) -> str:
    """Return how a cut is chosen: by what varies where that is little, and by its numbers."""
    keys = [str(key) for key in data["input_key"].values]
    told = ", ".join(f"{key.split('.')[-1]} {cell(sample[key])}" for key in keys) if len(keys) <= MOST_NAMED else ""
    return f"machine {sample['machine']}, cut {sample['cut']}{': ' if told else ''}{told}"


def _against_inputs(data: xr.Dataset, samples: pd.DataFrame) -> tuple[figure, Choices, dict[str, Model]]:
    """Return the lowest limit depth of every cut against the input that is chosen."""
    keys = [str(key) for key in data["input_key"].values]
    step = max(1, -(-len(samples) // MOST_POINTS))
    shown = samples.iloc[::step]
    values = data["input"].values.reshape(-1, len(keys))[::step]
    words = data.attrs["input_words"]
    read = {key: f"{key} ({numbered(words[key])})" if key in words else key for key in keys}
    choices = Choices({"input": read}, {"input": keys[0]}, width=WIDE)
    common = {
        "lowest": numbers(shown[LOWEST]),
        "rate": numbers(shown[BEST_RATE]),
        "machine": shown["machine"].values,
        "cut": shown["cut"].values,
    }
    source = choices.source({(key,): {"value": numbers(values[:, i])} for i, key in enumerate(keys)}, common)
    along = keys[0] if len(keys) == 1 else "value of the chosen input"
    made = plot("Lowest limit depth of every cut", along, "lowest limit depth [mm]")
    points = made.scatter("value", "lowest", source=source, size=5, color=COLOURS[0], alpha=0.5)
    rows_told = [
        ("machine, cut", "@machine, @cut"),
        ("value", "@value{%.5g}"),
        ("lowest limit depth", "@lowest{0.000} mm"),
        ("largest removal rate", "@rate{0.0} cm\N{SUPERSCRIPT THREE}/min"),
    ]
    made.add_tools(hover([points], rows_told))
    return made, choices, {}


def _tornado(told: pd.DataFrame, text: str) -> figure:
    """Return bars of what the limit depth depends on, the largest on top."""
    shown = told.head(MOST_INPUTS).iloc[::-1]
    keys = list(shown[KEY])
    swings = "change_at_low_percent" in shown
    label = "change of the lowest limit depth [%]" if swings else next(name for name in SHOWN if name in shown)
    # A title is not wrapped: a sentence a line.
    lines = text.replace(". ", ".\n")
    height = 120 + 22 * len(keys) + 18 * lines.count("\n")
    made = plot(lines, label.replace("_", " "), "", height=height, y_range=keys)
    if swings:
        entries = {}
        for end, colour in (("low", COLOURS[0]), ("high", COLOURS[1])):
            change = numbers(shown[f"change_at_{end}_percent"])
            bars = made.hbar(y=keys, right=change, height=0.7, color=colour, name=end)
            bars.data_source.data["at"] = [cell(value) for value in shown[end]]
            made.add_tools(hover([bars], [("key", "@y"), ("at", "@at"), ("change", "@right{+0.0} %")]))
            entries[f"at the {end} end"] = [bars]
        add_key(made, entries)
    else:
        bars = made.hbar(y=keys, right=numbers(shown[label]), height=0.7, color=COLOURS[0])
        rows = [("key", "@y"), (label.replace("_", " "), "@right{0.000}")]
        other = SHOWN[label] or "rank_correlation"
        bars.data_source.data["other"] = numbers(shown[other])
        made.add_tools(hover([bars], [*rows, (other.replace("_", " "), "@other{0.000}")]))
    return made
