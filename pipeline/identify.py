"""Modes at the tool tip from measured receptances: a machine for shops without a spindle drawing."""

import itertools
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from chatter_core.errors import InvalidInput
from chatter_core.evidence import Campaign, Responses, read_campaign, read_responses
from chatter_core.evidence.identified_tip import FREQUENCY_ERROR, GAIN_ERROR, IdentifiedTip, identify_tip
from chatter_core.evidence.identify import FEWEST_LINES, SEARCH
from chatter_core.evidence.measured import Receptance
from chatter_core.machine import MACHINE_FILE, Machine, TipMode
from chatter_core.tip import AXES
from chatter_core.units import si_factor
from pipeline import identify_figure
from pipeline.answer_folder import refuse_other_file, write_text
from pipeline.campaigns import remarks
from pipeline.configuration import Words, compose_settings, words_for
from pipeline.errors import told_where
from pipeline.locking import check_folder, make_folder
from pipeline.telling import fact, remark, say, wrote
from pipeline.verbs.campaigns import IdentifyOptions

#: What a machine needs beside its tip; nothing of it shows in a receptance.
REST = ("tool", "cutting", "process")
#: How the file begins.
HEAD = "# Tip modes identified from"
#: Digits that are written: of values, and of standard deviations.
DIGITS, DEVIATION_DIGITS = 6, 3


def run(words: list[str]) -> int:
    """Identify the tip from measured receptances and write it as a machine; return the exit code."""
    sorted_words = words_for(IdentifyOptions, words)
    options = IdentifyOptions.read(sorted_words.options)
    source = _source(options, sorted_words)
    _check_output(options, sorted_words)
    measured, machine = _read(options, sorted_words)
    rest = {key: value for key, value in machine.described().items() if key in REST} if machine else {}
    odd = _of_the_reader(measured)
    for line in odd:
        remark(line)
    if odd:
        say("")
    receptances = [_within(options, receptance) for receptance in measured.receptances if receptance.is_direct]
    check_folder(options.output.parent)
    try:
        found = identify_tip(receptances, mode_count=options.modes)
    except InvalidInput as error:
        # The identification speaks of mode_count, which is called modes here.
        problems = [problem.replace("mode_count:", "modes:", 1) for problem in error.problems]
        raise InvalidInput([f"{source}: {problem}" for problem in problems]) from None
    except (np.linalg.LinAlgError, MemoryError) as error:
        raise InvalidInput([f"{source}: no modes can be found in these receptances: {error}"]) from None
    make_folder(options.output.parent)
    with told_where(options.output):
        write_text(options.output, machine_file(found, rest, source.resolve().name))
        pictures = identify_figure.write(found, options.output)
    say(f"{table(found)}\n")
    for line in _remarks(found, rest):
        remark(line)
    fact(**found.tip.described())
    wrote([options.output, *pictures])
    return 0


def machine_file(found: IdentifiedTip, rest: dict[str, Any], source: str) -> str:
    """Return the machine as text: identified tip, and the rest as it was given."""
    modes = [
        {key: _rounded(value, DEVIATION_DIGITS if "deviation" in key else DIGITS) for key, value in mode.items()}
        for mode in found.tip.described()["modes"]
    ]
    head = (
        f"{HEAD} {source}; deviation: standard deviation, with {100 * GAIN_ERROR:g} % of gain\n"
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
        lines += ["", f"{measured}: {modes.statement()}"]
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


def _remarks(found: IdentifiedTip, rest: dict[str, Any]) -> list[str]:
    """Return what the reader of the machine should know beside its values."""
    common = f"{100 * GAIN_ERROR:g} % of gain and {100 * FREQUENCY_ERROR:g} % of frequency scale"
    remarks = [f"+-: standard deviation, with {common}"]
    remarks += _jumps(found)
    missing = {*AXES} - {AXES[measured.output_axis] for measured in found.receptances}
    remarks += [f"no receptance of {axis}: the machine is rigid in that axis" for axis in sorted(missing)]
    if not rest:
        remarks.append(f"to be added to the machine before it runs: {', '.join(REST)} (or name machine=FILE)")
    return remarks


def _jumps(found: IdentifiedTip) -> list[str]:
    """Return where modes of one number are so far apart at neighbouring speeds that they may be two."""
    remarks = []
    for (low, below), (high, above) in itertools.pairwise(zip(found.receptances, found.modes, strict=True)):
        if low.output_axis != high.output_axis:
            continue
        hertz = np.stack([below.natural_frequency, above.natural_frequency]) / si_factor("frequency_hz")
        for mode in np.flatnonzero(np.abs(np.log(hertz[1] / hertz[0])) > math.log(SEARCH)):
            remarks.append(
                f"doubtful: mode {mode + 1} is at {hertz[0, mode]:.0f} Hz for {low}, "
                f"at {hertz[1, mode]:.0f} Hz for {high}, and interpolated between; are they one mode?"
            )
    return remarks


def _check_output(options: IdentifyOptions, words: Words) -> None:
    if options.output.suffix not in (".yaml", ".yml"):
        raise InvalidInput([f"output: found {str(options.output)!r}, allowed: a file name ending in .yaml"])
    campaign = options.campaign / MACHINE_FILE if options.campaign else None
    for source in (options.frf, words.machine_file, campaign):
        if source is not None and source.resolve() == options.output.resolve():
            raise InvalidInput([f"output: {options.output} is an input of the same command; name another file"])
    refuse_other_file(options.output, "output", lambda first: first.startswith(HEAD))


def _source(options: IdentifyOptions, words: Words) -> Path:
    """Return the file or folder that receptances are read from; raise InvalidInput where it is not one."""
    if options.frf is not None and options.campaign is not None:
        raise InvalidInput(["campaign: found beside frf, allowed: one of them"])
    source = options.frf or options.campaign
    if source is None:
        raise InvalidInput(["frf: missing; needed: frf=FILE with receptances, or campaign=DIR"])
    if options.campaign is not None and words.of_machine:
        raise InvalidInput([f"{word}: not beside campaign, whose {MACHINE_FILE} is taken" for word in words.of_machine])
    return source


def _read(options: IdentifyOptions, words: Words) -> tuple[Responses | Campaign, Machine | None]:
    """Return what was measured, and the machine that is named or the campaign's, None where none is."""
    if options.campaign is not None:
        campaign = read_campaign(options.campaign)
        return campaign, campaign.machine
    machine = compose_settings(words).machine if words.of_machine else None
    assert options.frf is not None
    return read_responses(options.frf), machine


def _of_the_reader(measured: Responses | Campaign) -> list[str]:
    """Return what is to be told of the files before anything is identified."""
    told = remarks(measured)
    told += [f"left out: {r}, a cross receptance" for r in measured.receptances if not r.is_direct]
    told += [f"left out: {r}, its line at 0 Hz" for r in measured.receptances if r.is_direct and not r.frequency[0]]
    return told


def _within(options: IdentifyOptions, measured: Receptance) -> Receptance:
    """Return the lines in the band that is asked for; one at 0 Hz says nothing of a resonance.

    Raises InvalidInput where the band leaves too few lines of a response that has enough.
    """
    hertz = measured.frequency / si_factor("frequency_hz")
    kept = (hertz > 0.0) & (hertz >= options.lowest_frequency_hz) & (hertz <= options.highest_frequency_hz)
    if kept.sum() < FEWEST_LINES <= len(hertz):
        raise InvalidInput(
            [
                f"lowest_frequency_hz, highest_frequency_hz: found {options.lowest_frequency_hz:g} to "
                f"{options.highest_frequency_hz:g}, which leaves {kept.sum()} of the {len(hertz)} lines of {measured} "
                f"({hertz.min():g} to {hertz.max():g} Hz); at least {FEWEST_LINES} are needed"
            ]
        )
    return replace(measured, frequency=measured.frequency[kept], value=measured.value[kept])


def _rounded(value: Any, digits: int) -> Any:
    return float(f"{value:.{digits}g}") if isinstance(value, float) else value
