"""Figures of a judgement."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from benchmarks.blind.judgement import Case, confusion, reliability, stated_probability, stating


def reliability_diagram(cases: Sequence[Case]) -> Figure:
    """Return stated probabilities against frequencies, with the number of answers in each bin."""
    said = stating(cases)
    bins = reliability([stated_probability(case) for case in said], [case.first_is_right for case in said])
    figure = Figure(figsize=(5.0, 5.5), layout="constrained")
    axes = figure.subplots(2, height_ratios=(4, 1), sharex=True)
    stated, right = np.array([one.stated for one in bins]), np.array([one.right.value for one in bins])
    ends = np.array([[one.right.low, one.right.high] for one in bins]).reshape(-1, 2)
    axes[0].plot([0, 1], [0, 1], color="0.6", linewidth=1)
    axes[0].errorbar(stated, right, np.abs(ends.T - right), fmt="o", capsize=3, clip_on=False)
    axes[0].set(ylabel="share that was right", xlim=(0, 1), ylim=(0, 1))
    middles = [0.5 * (one.low + one.high) for one in bins]
    drawn = axes[1].bar(middles, [one.right.count for one in bins], width=0.09, color="0.6")
    axes[1].bar_label(drawn)
    axes[1].margins(y=0.3)
    axes[1].set(xlabel="stated probability of the most probable answer", ylabel="answers")
    return figure


def confusion_figure(cases: Sequence[Case]) -> Figure:
    """Return what was hidden against what was answered, as counts."""
    rows, columns, table = confusion(cases)
    figure = Figure(figsize=(2.5 + 0.38 * len(columns), 2.2 + 0.3 * len(rows)), layout="constrained")
    axes = figure.subplots()
    shares = table / np.maximum(table.sum(axis=1, keepdims=True), 1)
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for row, column in zip(*np.nonzero(table), strict=True):
        dark = shares[row, column] > 0.6
        axes.text(column, row, str(table[row, column]), ha="center", va="center", color="white" if dark else "black")
    axes.set_xticks(range(len(columns)), columns, rotation=60, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(rows)), rows)
    axes.set(xlabel="answer", ylabel="hidden")
    return figure


def error_figure(cases: Sequence[Case]) -> Figure:
    """Return held-out outcome errors of each case: the refitted base against the model that the answer stands for."""
    known = [case for case in cases if {"refitted", "answered"} <= case.errors.keys()]
    figure = Figure(figsize=(5.0, 5.0), layout="constrained")
    axes = figure.subplots()
    for kind in ("none", "one", "two", "foreign"):
        of = [case for case in known if case.kind == kind]
        before = [100.0 * case.errors["refitted"] for case in of]
        after = [100.0 * case.errors["answered"] for case in of]
        axes.plot(before, after, "o", alpha=0.6, label=f"{kind}, {len(of)}")
    top = max(axes.get_xlim()[1], axes.get_ylim()[1])
    axes.plot([0, top], [0, top], color="0.6", linewidth=1)
    axes.set(xlabel="error of the refitted base [%]", ylabel="error of the answered model [%]")
    axes.legend(title="hidden, campaigns")
    return figure
