"""Modes at the tool tip from measured receptances: a machine for shops without a spindle drawing."""

import csv
import itertools
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from chatter_core.errors import InvalidInput
from chatter_core.evidence.identified_tip import (
    FREQUENCY_ERROR,
    GAIN_ERROR,
    IdentifiedTip,
    MeasuredReceptance,
    identify_tip,
)
from chatter_core.evidence.identify import MOST_MODES, SEARCH
from chatter_core.machine import TipMode
from chatter_core.reading import sentences
from chatter_core.units import si_factor
from pipeline import identify_figure
from pipeline.configuration import Words, compose_settings, make_folder, sort_words

#: What a machine needs beside its tip; nothing of it shows in a receptance.
REST = ("tool", "cutting", "process")
#: Columns of a file of receptances.
COLUMNS = ("spindle_speed_rpm", "frequency_hz", "output_axis", "input_axis", "real_um_n", "imag_um_n")
#: Digits that are written: of values, and of standard deviations.
DIGITS, DEVIATION_DIGITS = 6, 3


class IdentifyOptions(BaseModel):
    """What ``identify`` takes beside the machine whose tool, cutting and process are kept."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    frf: Path = Field(description="CSV file of receptances at the tool tip")
    modes: int | None = Field(default=None, ge=1, le=MOST_MODES, description="modes of every receptance")
    lowest_frequency_hz: float = Field(default=0.0, ge=0, le=1e6, description="lines below are left out")
    highest_frequency_hz: float = Field(default=1e6, gt=0, le=1e6, description="lines above are left out")
    output: Path = Field(default=Path("results/identify/machine_tip.yaml"), description="machine file to write")


def run(words: list[str]) -> int:
    """Identify the tip from a file of receptances and write it as a machine; return the exit code."""
    sorted_words = sort_words(words, tuple(IdentifyOptions.model_fields))
    try:
        options = IdentifyOptions.model_validate(sorted_words.options)
    except ValidationError as error:
        raise InvalidInput(sentences(error, IdentifyOptions)) from None
    _check_output(options, sorted_words)
    rest = _rest_of_machine(sorted_words)
    receptances, left_out = _receptances_of(options.frf)
    receptances = [_within(options, measured) for measured in receptances]
    try:
        found = identify_tip(receptances, mode_count=options.modes)
    except InvalidInput as error:
        # The identification speaks of mode_count, which is called modes here.
        problems = [problem.replace("mode_count:", "modes:", 1) for problem in error.problems]
        raise InvalidInput([f"{options.frf}: {problem}" for problem in problems]) from None
    make_folder(options.output.parent)
    options.output.write_text(machine_file(found, rest, options.frf.name), encoding="utf-8")
    pictures = identify_figure.write(found, options.output)
    print(table(found))
    print("\n".join(["", *_remarks(found, left_out, rest)]))
    for path in [options.output, *pictures]:
        print(f"written: {path}")
    return 0


def machine_file(found: IdentifiedTip, rest: dict[str, Any], source: str) -> str:
    """Return the machine as text: identified tip, and the rest as it was given."""
    modes = [
        {key: _rounded(value, DEVIATION_DIGITS if "deviation" in key else DIGITS) for key, value in mode.items()}
        for mode in found.tip.described()["modes"]
    ]
    head = (
        f"# Tip modes identified from {source}; deviation: standard deviation, with {100 * GAIN_ERROR:g} % of gain\n"
        f"# and {100 * FREQUENCY_ERROR:g} % of frequency scale, which all modes of a receptance share.\n"
    )
    body = yaml.safe_dump({"tip": {"modes": modes}, **rest}, sort_keys=False, default_flow_style=None, width=200)
    missing = "" if rest else f"# To be added before it runs: {', '.join(REST)}.\n"
    return head + body + missing


def table(found: IdentifiedTip) -> str:
    """Return the modes as text for a terminal, with the standard deviations that the machine gets."""
    lines: list[str] = []
    described = iter(found.tip.modes)
    for measured, modes in zip(found.receptances, found.modes, strict=True):
        lines += ["", f"{measured.name}: {modes.statement()}"]
        lines.append("  mode      frequency Hz          damping ratio         stiffness N/um        peak um/N")
        lines += [f"  {number:>4}  {_row(next(described))}" for number in range(1, len(modes) + 1)]
        above = modes.compliance_above / si_factor("x_um")
        lines.append(f"  outside the band, and not in the machine: static compliance {above:.3g} um/N")
    return "\n".join(lines[1:])


def _row(mode: TipMode) -> str:
    """Return a mode as a row; an identified mode has all its deviations."""
    values = mode.described()
    cells = [
        f"{values[key]:>{width}.{digits}g} +- {values[deviation]:<8.2g}"
        for key, deviation, width, digits in (
            ("natural_frequency_hz", "natural_frequency_deviation_hz", 8, 5),
            ("damping_ratio", "damping_ratio_deviation", 10, 4),
            ("stiffness_n_um", "stiffness_deviation_n_um", 10, 4),
        )
    ]
    return "".join(cells) + f"{1.0 / (2.0 * values['damping_ratio'] * values['stiffness_n_um']):>10.3g}"


def _remarks(found: IdentifiedTip, left_out: list[str], rest: dict[str, Any]) -> list[str]:
    """Return what the reader of the machine should know beside its values."""
    common = f"{100 * GAIN_ERROR:g} % of gain and {100 * FREQUENCY_ERROR:g} % of frequency scale"
    remarks = [f"+-: standard deviation, with {common}"]
    remarks += [f"left out: {what}" for what in left_out]
    remarks += _jumps(found)
    missing = {"x", "y"} - {measured.axis for measured in found.receptances}
    remarks += [f"no receptance of {axis}: the machine is rigid in that axis" for axis in sorted(missing)]
    if not rest:
        remarks.append(f"to be added to the machine before it runs: {', '.join(REST)} (or name machine=FILE)")
    return remarks


def _jumps(found: IdentifiedTip) -> list[str]:
    """Return where modes of one number are so far apart at neighbouring speeds that they may be two."""
    remarks = []
    for (low, below), (high, above) in itertools.pairwise(zip(found.receptances, found.modes, strict=True)):
        if low.axis != high.axis:
            continue
        hertz = np.stack([below.natural_frequency, above.natural_frequency]) / si_factor("frequency_hz")
        for mode in np.flatnonzero(np.abs(np.log(hertz[1] / hertz[0])) > math.log(SEARCH)):
            remarks.append(
                f"doubtful: mode {mode + 1} is at {hertz[0, mode]:.0f} Hz for {low.name}, "
                f"at {hertz[1, mode]:.0f} Hz for {high.name}, and interpolated between; are they one mode?"
            )
    return remarks


def _check_output(options: IdentifyOptions, words: Words) -> None:
    if options.output.suffix not in (".yaml", ".yml"):
        raise InvalidInput([f"output: found {str(options.output)!r}, allowed: a file name ending in .yaml"])
    for source in (options.frf, words.machine_file):
        if source is not None and source.resolve() == options.output.resolve():
            raise InvalidInput([f"output: {options.output} is an input of the same command; name another file"])


def _rest_of_machine(words: Words) -> dict[str, Any]:
    """Return tool, cutting and process of the machine that is named, nothing where none is."""
    if words.machine_file is None and not words.choices and not words.values:
        return {}
    described = compose_settings(words).machine.described()
    return {key: described[key] for key in REST}


def _within(options: IdentifyOptions, measured: MeasuredReceptance) -> MeasuredReceptance:
    """Return the lines in the band that is asked for."""
    hertz = measured.frequency / si_factor("frequency_hz")
    kept = (hertz >= options.lowest_frequency_hz) & (hertz <= options.highest_frequency_hz)
    return MeasuredReceptance(
        axis=measured.axis,
        spindle_speed=measured.spindle_speed,
        frequency=measured.frequency[kept],
        receptance=measured.receptance[kept],
    )


def _receptances_of(path: Path) -> tuple[list[MeasuredReceptance], list[str]]:
    """Read the direct receptances in a CSV file, and say what was left out.

    Raises InvalidInput, naming file, line and column, for what cannot be read.
    """
    lines: dict[tuple[str, str, float], dict[float, complex]] = {}
    for number, row in _rows(path):
        axes = (row["output_axis"], row["input_axis"])
        if not {*axes} <= {"x", "y"}:
            raise InvalidInput([f"{path}, line {number}: axes: found {axes[0]!r} and {axes[1]!r}, allowed: x, y"])
        speed, hertz, real, imag = (_number(path, number, key, row[key]) for key in (*COLUMNS[:2], *COLUMNS[4:]))
        values = lines.setdefault((*axes, speed), {})
        if hertz in values:
            where = f"{axes[0]} over {axes[1]} at {speed:g} rpm"
            raise InvalidInput([f"{path}, line {number}: frequency_hz: {hertz:g} stands twice for {where}"])
        values[hertz] = complex(real, imag)
    direct = [
        MeasuredReceptance(
            axis="x" if output == "x" else "y",
            spindle_speed=speed * si_factor("speed_rpm"),
            frequency=np.array(sorted(values)) * si_factor("frequency_hz"),
            receptance=np.array([values[hertz] * si_factor("x_um") for hertz in sorted(values)]),
        )
        for (output, force, speed), values in lines.items()
        if output == force
    ]
    cross = [
        f"{output} over {force} at {speed:g} rpm, a cross receptance"
        for output, force, speed in lines
        if output != force
    ]
    return direct, cross


def _rows(path: Path) -> Iterator[tuple[int, dict[str, str]]]:
    """Yield line number and row of a CSV file; raise InvalidInput when it cannot be read."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file)
            missing = [column for column in COLUMNS if column not in (reader.fieldnames or [])]
            if missing:
                raise InvalidInput([f"{path}: missing columns: {', '.join(missing)}; needed: {', '.join(COLUMNS)}"])
            for row in reader:
                yield reader.line_num, {column: row[column] or "" for column in COLUMNS}
    except FileNotFoundError:
        raise InvalidInput([f"{path}: no such file"]) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InvalidInput([f"{path}: is no CSV text: {error}"]) from None


def _number(path: Path, line: int, column: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InvalidInput([f"{path}, line {line}: {column}: found {text!r}, allowed: a finite number"])
    return value


def _rounded(value: Any, digits: int) -> Any:
    return float(f"{value:.{digits}g}") if isinstance(value, float) else value
