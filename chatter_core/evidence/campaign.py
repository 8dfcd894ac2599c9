"""A measurement campaign: one folder with the machine as it is believed to be, and what was measured.

Every file but machine.yaml may be left away, and one at least holds a measurement. Errors are what
makes a file unreadable or contradictory; what is only odd is a remark.
"""

import difflib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from chatter_core.cards import Card, ShownAsCard
from chatter_core.errors import InvalidInput
from chatter_core.evidence.columns import NO_WORD
from chatter_core.evidence.findings import Findings, checked_file
from chatter_core.evidence.measured import (
    BEARING,
    DIRECTIONS,
    LIMITS,
    MODES,
    OUTCOMES,
    PLANNED,
    RECEPTANCE,
    STABILITY,
    TABLES,
    BearingStiffness,
    Limits,
    NaturalFrequencies,
    Receptance,
    Responses,
    Trials,
)
from chatter_core.evidence.oddities import odd_receptance, oddities
from chatter_core.evidence.table import Rows, read_table
from chatter_core.evidence.uff import UFF_ENDINGS, read_uff
from chatter_core.machine import MACHINE_FILE, Machine
from chatter_core.parameters import Array
from chatter_core.reading import near_path, printable, read_machine
from chatter_core.units import si_factor

#: No motion is as small [m/N]: an atom's size at a meganewton is 1e-16.
LEAST_RECEPTANCE = 1e-30
#: Receptances and remarks that a campaign shows of itself.
SHOWN = 3
#: Endings of files that are probably meant to be read.
TABLE_ENDINGS = (".csv", ".tsv", ".xls", ".xlsx", ".ods")

P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True, kw_only=True, repr=False)
class Campaign(ShownAsCard):
    """What was measured on a machine; None or empty where nothing was.

    remarks: what is odd and should be told, though it can be read; unknown_columns: file and name
    of the columns that the program does not know.
    """

    machine: Machine
    trials: Trials | None
    receptances: tuple[Receptance, ...]
    natural_frequencies: NaturalFrequencies | None
    stiffness: BearingStiffness | None
    limits: Limits | None
    remarks: tuple[str, ...]
    unknown_columns: tuple[str, ...]

    def card(self) -> Card:
        """Return what was measured, and what its reader found odd."""
        tables = {
            "natural frequencies": self.natural_frequencies,
            "bearing stiffness": self.stiffness,
            "limit depths": self.limits,
        }
        rows = [("trial cuts", _told_trials(self.trials))] if self.trials is not None else []
        if self.receptances:
            rows.append(("receptances", f"{len(self.receptances)}: {', '.join(map(str, self.receptances[:SHOWN]))}"))
        rows += [(name, f"{len(table.spindle_speed)} rows") for name, table in tables.items() if table is not None]
        rows += [("remark", remark) for remark in self.remarks[:SHOWN]]
        return Card(title="Campaign", rows=tuple(rows))

    @property
    def cut_speeds(self) -> Array:
        """Spindle speeds [rad/s] of trial cuts, then of limiting depths, (cut,)."""
        tables = [table.spindle_speed for table in (self.trials, self.limits) if table is not None]
        return np.concatenate([np.empty(0), *tables])

    @property
    def cut_depths(self) -> Array:
        """Axial depths [m] of trial cuts, then limiting depths, (cut,)."""
        tried = [] if self.trials is None else [self.trials.axial_depth]
        limits = [] if self.limits is None else [self.limits.limit_depth]
        return np.concatenate([np.empty(0), *tried, *limits])

    @property
    def extreme_preloads(self) -> tuple[float, ...]:
        """The smallest and the largest preload [N] that rows of the tables state; none where none does."""
        tables = [table.preload for table in (self.trials, self.stiffness) if table is not None]
        stated = np.concatenate([np.empty(0), *tables])
        stated = stated[np.isfinite(stated)]
        return (float(stated.min()), float(stated.max())) if len(stated) else ()


def read_campaign(folder: str | Path) -> Campaign:
    """Return the campaign in a folder.

    Raises InvalidInput with the findings of all files, each naming file, line and column or key, what
    was found and what is allowed.
    """
    folder = Path(folder)
    if not folder.is_dir():
        what = "is a file" if folder.is_file() else "no such folder"
        meant = f"; did you mean {folder.parent}?" if folder.is_file() else near_path(folder)
        raise InvalidInput([f"{folder}: {what}; a campaign is a folder with {MACHINE_FILE} and measurements{meant}"])
    unread = _unread_files(folder)
    machine_problems: list[str] = []
    problems: list[str] = []
    remarks: list[str] = []
    machine = _noting(machine_problems, _machine, folder / MACHINE_FILE)
    rows = _all_rows(folder, problems, remarks)
    receptances = _receptances(rows[RECEPTANCE.file], RECEPTANCE.file) if RECEPTANCE.file in rows else []
    for path in sorted(path for path in folder.iterdir() if path.suffix.lower() in UFF_ENDINGS):
        found = _noting(problems, read_uff, path)
        if found is not None:
            receptances += found.receptances
            remarks += found.remarks
    problems += [*_measured_twice(folder, receptances), *_without_motion(folder, receptances)]
    if receptances and not any(receptance.is_direct for receptance in receptances):
        unread += _without_measure(receptances)
        receptances = []
        rows.pop(RECEPTANCE.file, None)
    if machine is not None and machine.spindle is None and BEARING.file in rows:
        del rows[BEARING.file]
        unread.append(f"{BEARING.file}: is not used, the machine's measured tip modes know no bearings")
    if not problems and not rows and not receptances:
        problems.append(_nothing_measured(folder, unread))
    if RECEPTANCE.file in rows:
        problems += _other_preloads(folder / RECEPTANCE.file, rows[RECEPTANCE.file], machine)
    if STABILITY.file in rows and machine is not None:
        problems += _contradictions(folder / STABILITY.file, rows[STABILITY.file], machine)
    if problems or machine is None:
        raise InvalidInput(machine_problems + problems)
    return Campaign(
        machine=machine,
        trials=_trials(rows[STABILITY.file]) if STABILITY.file in rows else None,
        receptances=tuple(receptances),
        natural_frequencies=_natural_frequencies(rows[MODES.file]) if MODES.file in rows else None,
        stiffness=_stiffness(rows[BEARING.file]) if BEARING.file in rows else None,
        limits=_limits(rows[LIMITS.file]) if LIMITS.file in rows else None,
        remarks=(*unread, *remarks, *oddities(rows, receptances, machine)),
        unknown_columns=tuple(name for file, found in rows.items() for name in _unknown_columns(found, file)),
    )


def read_responses(path: Path) -> Responses:
    """Return the receptances in one file, checked as a campaign's: a universal file, or a table as frf.csv is.

    Raises InvalidInput with the findings, each naming file, line and column or record, what was found
    and what is allowed.
    """
    if path.suffix.lower() in UFF_ENDINGS:
        found = read_uff(path)
    else:
        rows = read_table(path, RECEPTANCE)
        if not len(rows):
            raise InvalidInput([f"{path}: holds a header and no rows, needed: a line for each frequency"])
        if other := _other_preloads(path, rows):
            raise InvalidInput(other)
        found = Responses(
            receptances=tuple(_receptances(rows, path.name)), unknown_columns=_unknown_columns(rows, path.name)
        )
    problems = [*_measured_twice(path.parent, found.receptances), *_without_motion(path.parent, found.receptances)]
    if problems:
        raise InvalidInput(problems)
    odd = [remark for receptance in found.receptances for remark in odd_receptance(receptance)]
    return replace(found, remarks=(*found.remarks, *odd))


def planned_trials(path: Path, machine: Machine) -> tuple[Trials, NDArray[np.intp]]:
    """Return cuts that are not judged yet from a table, and their order in the file, (trial,).

    Raises InvalidInput with the findings, each naming file, line and column, what was found and what is
    allowed.
    """
    rows = read_table(path, PLANNED)
    if not len(rows):
        raise InvalidInput([f"{path}: holds a header and no rows, needed: a line for each cut"])
    problems = _contradictions(path, rows, machine)
    if problems:
        raise InvalidInput(problems)
    nothing = np.full(len(rows), np.nan)
    silent = {"outcome": np.zeros(len(rows)), "chatter_frequency": nothing}
    return _trials(replace(rows, columns={**rows.columns, **silent})), np.argsort(rows.line, kind="stable")


def _told_trials(trials: Trials) -> str:
    """Return how many cuts were judged how, and at which speeds."""
    counts = ", ".join(f"{int((trials.outcome == code).sum())} {name}" for code, name in enumerate(OUTCOMES))
    rpm = trials.spindle_speed / si_factor("spindle_speed_rpm")
    return f"{len(trials)}: {counts}; {rpm.min():g} to {rpm.max():g} rpm"


def is_read(name: str) -> bool:
    """Return whether a file of this name in a campaign's folder is part of the campaign.

    See docs/physics.md#comparison.
    """
    return name in (MACHINE_FILE, *(table.file for table in TABLES)) or name.lower().endswith(UFF_ENDINGS)


def _noting(problems: list[str], read: Callable[P, T], *what: P.args, **how: P.kwargs) -> T | None:
    """Return what can be read, None where it cannot be and its problems are noted."""
    try:
        return read(*what, **how)
    except InvalidInput as error:
        problems.extend(error.problems)
        return None


def _machine(path: Path) -> Machine:
    """Return the machine; raise InvalidInput when its file is missing or wrong."""
    if not (path.exists() or path.is_symlink()):
        raise InvalidInput(
            [
                f"{path}: no such file; needed: the machine as it is believed to be; "
                "`python -m pipeline template output=DIR` writes one to fill in"
            ]
        )
    return read_machine(checked_file(path))


def _all_rows(folder: Path, problems: list[str], remarks: list[str]) -> dict[str, Rows]:
    """Return the rows of every table that holds some, by file."""
    rows = {}
    for table in TABLES:
        path = folder / table.file
        if path.exists() or path.is_symlink():
            found = _noting(problems, read_table, path, table)
            if found is not None and len(found):
                rows[table.file] = found
            elif found is not None:
                remarks.append(f"{table.file}: holds a header and no rows, nothing was read from it")
    return rows


def _unread_files(folder: Path) -> list[str]:
    """Return a remark for every file that looks like a table and is none of a campaign's."""
    names = [table.file for table in TABLES]
    remarks = []
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in TABLE_ENDINGS and path.name not in names:
            close = difflib.get_close_matches(path.name.lower(), names, n=1)
            remarks.append(f"{printable(path.name)}: is not read" + (f"; did you mean {close[0]}?" if close else ""))
    return remarks


def _nothing_measured(folder: Path, unread: list[str]) -> str:
    files = ", ".join([table.file for table in TABLES] + [f"*{ending}" for ending in UFF_ENDINGS])
    found = f" ({'; '.join(unread)})" if unread else ""
    return f"{folder}: no measurement yet; needed: rows in one at least of {files}{found}"


def _measured_twice(folder: Path, receptances: Sequence[Receptance]) -> list[str]:
    """Return a finding for every response that two files or two records hold."""
    problems = []
    first: dict[str, Receptance] = {}
    for receptance in receptances:
        other = first.setdefault(str(receptance), receptance)
        if other is not receptance:
            problems.append(
                f"{folder / receptance.source}: receptance {receptance} stands in {other.source} too; keep one of them"
            )
    return problems


def _without_motion(folder: Path, receptances: Sequence[Receptance]) -> list[str]:
    """Return a finding for every response that is zero on all lines, and so has no errors to be weighed by."""
    return [
        f"{folder / receptance.source}: receptance {receptance} is zero on every line; leave it out where nothing was "
        "measured"
        for receptance in receptances
        if not np.abs(receptance.value).max() > LEAST_RECEPTANCE
    ]


def _other_preloads(path: Path, rows: Rows, machine: Machine | None = None) -> list[str]:
    """Return a finding where receptances are stated to be of several preloads, or of another than the machine's."""
    stated = np.unique(rows.columns["preload"][~np.isnan(rows.columns["preload"])])
    findings = Findings(path)
    own = None if machine is None or machine.spindle is None else machine.spindle.preload
    others = len(stated) > 1 if own is None else not np.isclose(stated, own, rtol=1e-6).all()
    if others:
        needed = "one for all" if own is None else f"{own:g}, the machine's own"
        findings.add(
            f"found {' and '.join(f'{one:g}' for one in stated)}, needed: {needed}; receptances under another preload "
            f"are a campaign of their own, with that preload in its {MACHINE_FILE}",
            column="preload_n",
        )
    return findings.sentences()


def _without_measure(receptances: Sequence[Receptance]) -> list[str]:
    """Return a remark for every response across the axes beside which there is no direct one."""
    return [
        f"{receptance.source}: receptance {receptance} is not used; no direct one, x over x or y over y, tells how "
        "much of it is noise"
        for receptance in receptances
    ]


def _contradictions(path: Path, rows: Rows, machine: Machine) -> list[str]:
    """Return a finding for every trial whose direction and immersion exclude each other."""
    own, findings = machine.process, Findings(path)
    immersion = np.where(
        np.isnan(rows.columns["radial_immersion"]), own.radial_immersion, rows.columns["radial_immersion"]
    )
    direction = rows.codes("direction")
    direction = np.where(direction == NO_WORD, DIRECTIONS.index(own.direction), direction)
    for row in np.flatnonzero((direction == DIRECTIONS.index("slot")) & (immersion != 1.0)):
        findings.add(
            f"direction slot needs 1, found {immersion[row]:g}", line=int(rows.line[row]), column="radial_immersion"
        )
    return findings.sentences()


def _trials(rows: Rows) -> Trials:
    frequency = rows.columns["chatter_frequency"].copy()
    # A stable cut has forced vibration alone: whatever was noted there is no chatter frequency.
    frequency[rows.codes("outcome") == OUTCOMES.index("stable")] = np.nan
    return Trials(
        trial=rows.numbers("trial"),
        spindle_speed=rows.columns["spindle_speed"],
        axial_depth=rows.columns["axial_depth"],
        outcome=rows.codes("outcome"),
        chatter_frequency=frequency,
        preload=rows.columns["preload"],
        radial_immersion=rows.columns["radial_immersion"],
        feed_per_tooth=rows.columns["feed_per_tooth"],
        direction=rows.codes("direction"),
        unknown=rows.unknown,
    )


def _unknown_columns(rows: Rows, file: str) -> tuple[str, ...]:
    """Return file and name of the columns that the program does not know."""
    return tuple(f"{file}: {key}" for key in rows.unknown)


def _receptances(rows: Rows, source: str) -> list[Receptance]:
    """Return the rows as one response for each speed, output and input axis."""
    speed, output, input_ = (rows.columns[name] for name in ("spindle_speed", "output_axis", "input_axis"))
    value = rows.columns["real"] + 1j * rows.columns["imag"]
    changes = (np.diff(speed) != 0) | (np.diff(output) != 0) | (np.diff(input_) != 0)
    starts = [0, *(np.flatnonzero(changes) + 1)]
    return [
        Receptance(
            source=source,
            spindle_speed=float(speed[start]),
            output_axis=int(output[start]),
            input_axis=int(input_[start]),
            frequency=rows.columns["frequency"][start:end],
            value=value[start:end],
        )
        for start, end in zip(starts, [*starts[1:], len(rows)], strict=True)
    ]


def _natural_frequencies(rows: Rows) -> NaturalFrequencies:
    return NaturalFrequencies(
        spindle_speed=rows.columns["spindle_speed"],
        mode=rows.numbers("mode"),
        natural_frequency=rows.columns["natural_frequency"],
        damping_ratio=rows.columns["damping_ratio"],
    )


def _stiffness(rows: Rows) -> BearingStiffness:
    return BearingStiffness(**{field.name: rows.columns[field.name] for field in fields(BearingStiffness)})


def _limits(rows: Rows) -> Limits:
    return Limits(**{field.name: rows.columns[field.name] for field in fields(Limits)})
