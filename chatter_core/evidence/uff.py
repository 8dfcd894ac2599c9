"""Receptances from universal files (dataset 58), the format that modal analysis programs exchange.

All responses of a file are at one node, the tool tip; response and reference directions give the axes,
+X and -X and so on, a negative one turning the sign. The spindle speed stands in one of the five id
lines as spindle_speed_rpm=8000; without it the spindle is at rest. Units are those of dataset 164, SI
where there is none. Accelerance and mobility become receptance by 1 / (i w)^2 and 1 / (i w).
"""

import math
import re
import unicodedata
from pathlib import Path
from typing import Any

import numpy as np

from chatter_core.errors import InvalidInput
from chatter_core.evidence.findings import Findings, checked_file
from chatter_core.evidence.measured import RECEPTANCE, Receptance, Responses
from chatter_core.reading import shown
from chatter_core.tip import AXES
from chatter_core.units import si_factor

UFF_ENDINGS = (".uff", ".unv")
#: Codes of dataset 58: a frequency response; ordinates, with how often a displacement is derived and
#: the label of their SI unit; forces; frequency.
FREQUENCY_RESPONSE = 4
ORDINATES = {8: (0, "m"), 11: (1, "m/s"), 12: (2, "m/s2")}
FORCES = (9, 13)
FREQUENCY = 18
COMPLEX = (5, 6)
#: The third translation of dataset 58: it has no part in the milling model.
ALONG_Z = 3
ID_LINES = ("id1", "id2", "id3", "id4", "id5")
COLUMNS = {column.name: column for column in RECEPTANCE.columns}


def read_uff(path: Path) -> Responses:
    """Return the receptances in a universal file, and what was left out or assumed.

    Raises InvalidInput with the findings, each naming file and record: what cannot be a receptance of
    the tool tip, units that are not known, numbers that are missing or out of range.
    """
    findings, remarks = Findings(path), []
    records = _records(checked_file(path))
    responses = {n: r for n, r in records.items() if r["type"] == 58 and r["func_type"] == FREQUENCY_RESPONSE}
    remarks += [
        f"{path.name}: record {number} is no frequency response and is left out"
        for number, record in records.items()
        if record["type"] == 58 and number not in responses
    ]
    units = _units(records, findings)
    if not responses:
        findings.add("holds no frequency response in dataset 58")
    elif units is None:
        remarks.append(f"{path.name}: names no units (dataset 164), SI is assumed")
    nodes = {record[key] for record in responses.values() for key in ("rsp_node", "ref_node")}
    if len(nodes) > 1:
        findings.add(f"found nodes {', '.join(map(str, sorted(nodes)))}, allowed: one, the tool tip; export it alone")
    receptances = []
    for number, record in responses.items():
        problem = _problem(record, units)
        if problem:
            findings.add(f"record {number}: {problem}")
        elif ALONG_Z in (abs(record["rsp_dir"]), abs(record["ref_dir"])):
            remarks.append(f"{path.name}: record {number} is along z, which the model does not know, and is left out")
        else:
            receptances.append(_receptance(record, number, units or 1.0, path, findings, remarks))
    findings.raise_any()
    return Responses(receptances=tuple(receptances), remarks=tuple(remarks))


def _records(path: Path) -> dict[int, dict[str, Any]]:
    """Return the responses and units of a universal file by their number: the one place that knows pyuff."""
    # Here, because a campaign without such files does without the package too.
    import pyuff

    try:
        file = pyuff.UFF(str(path))
        kinds = [int(kind) for kind in file.get_set_types()]
        return {index + 1: file.read_sets(index) for index, kind in enumerate(kinds) if kind in (58, 164)}
    except Exception:  # it raises nothing more precise
        raise InvalidInput(
            [f"{path}: cannot be read as a universal file; export it again, as ASCII dataset 58"]
        ) from None


def _units(records: dict[int, dict[str, Any]], findings: Findings) -> float | None:
    """Return the SI value of the file's unit of length over its unit of force, None where it names none."""
    found = {(r["length"], r["force"]) for r in records.values() if r["type"] == 164}
    if not found:
        return None
    length, force = min(found)
    if len(found) > 1 or not (0 < length < math.inf and 0 < force < math.inf):
        findings.add("dataset 164 needs one positive factor each for length and force; export in SI units")
        return 1.0
    # The factors lead from SI to the file's units.
    return float(force / length)


def _problem(record: dict[str, Any], units: float | None) -> str | None:
    """Return why a response cannot be taken for a receptance of the tip, None when it can."""
    for what, key in (("response", "rsp_dir"), ("reference", "ref_dir")):
        if not 1 <= abs(record[key]) <= ALONG_Z:
            return f"found {what} direction {record[key]}, allowed: the translations 1, 2, 3 and -1, -2, -3"
    ordinate = record["ordinate_spec_data_type"]
    if ordinate not in ORDINATES:
        return f"found an ordinate of type {ordinate}, allowed: 8 displacement, 11 velocity, 12 acceleration"
    if record["orddenom_spec_data_type"] not in FORCES:
        return f"found a denominator of type {record['orddenom_spec_data_type']}, allowed: 13 or 9, a force"
    if record["abscissa_spec_data_type"] != FREQUENCY or _label(record, "abscissa") not in ("", "none", "hz"):
        return f"found an abscissa of type {record['abscissa_spec_data_type']}, allowed: 18, frequency in Hz"
    if record["ord_data_type"] not in COMPLEX:
        return "found real numbers, allowed: complex ones"
    if not 0 < record["num_pts"] == len(record["data"]):
        return f"found {len(record['data'])} lines, its header says {record['num_pts']}; the file is cut off"
    if len(record["x"]) != len(record["data"]):
        return f"found {len(record['x'])} frequencies for {len(record['data'])} responses; the file is damaged"
    return _unknown_unit(record, units)


def _unknown_unit(record: dict[str, Any], units: float | None) -> str | None:
    """Return what is wrong with the units that the labels name."""
    wanted = ORDINATES[record["ordinate_spec_data_type"]][1]
    found, force = _label(record, "ordinate"), _label(record, "orddenom")
    # Dataset 164 speaks for lengths and forces, and never for multiples of gravity.
    if units is not None and not found.startswith("g"):
        return None
    if found in ("", "none", wanted, f"{wanted}/n") and force in ("", "none", "n"):
        return None
    return f"found units {shown(found)} over {shown(force)}, allowed: {wanted} over n; export in SI units"


def _label(record: dict[str, Any], axis: str) -> str:
    """Return an axis' unit as it is labelled, without blanks, brackets and signs of powers."""
    text = unicodedata.normalize("NFKC", str(record[f"{axis}_axis_units_lab"]))
    return re.sub(r"[\s^*()\[\]]", "", text).lower()


def _receptance(
    record: dict[str, Any], number: int, units: float, path: Path, findings: Findings, remarks: list[str]
) -> Receptance:
    """Return a response as displacement over force in SI, ascending in frequency."""
    order = np.argsort(record["x"], kind="stable")
    hertz, value = np.asarray(record["x"], dtype=float)[order], np.asarray(record["data"], dtype=complex)[order]
    derivatives = ORDINATES[record["ordinate_spec_data_type"]][0]
    if derivatives and (hertz == 0.0).any():
        remarks.append(f"{path.name}: record {number} has no displacement at 0 Hz, that line is left out")
        hertz, value = hertz[hertz != 0.0], value[hertz != 0.0]
    frequency = hertz * si_factor("frequency_hz")
    sign = np.sign(record["rsp_dir"]) * np.sign(record["ref_dir"])
    # Whatever is not finite is told below.
    with np.errstate(all="ignore"):
        value = sign * units * value / (1j * frequency) ** derivatives
    if not len(hertz):
        findings.add(f"record {number}: holds no line above 0 Hz")
    for name, numbers in (
        ("frequency", hertz),
        ("real", value.real / si_factor("real_um_n")),
        ("imag", value.imag / si_factor("imag_um_n")),
    ):
        wrong = numbers[~COLUMNS[name].bounds.inside(numbers)]
        if len(wrong):
            findings.add(f"record {number}: {name}: found {wrong[0]:g}, allowed: {COLUMNS[name].allowed}")
    if np.any(np.diff(hertz) == 0):
        twice = hertz[1:][np.diff(hertz) == 0][0]
        findings.add(f"record {number}: frequency {twice:g} Hz stands twice; keep one of them")
    return Receptance(
        source=path.name,
        spindle_speed=_speed(record, number, findings) * si_factor("spindle_speed_rpm"),
        output_axis=_axis(record["rsp_dir"]),
        input_axis=_axis(record["ref_dir"]),
        frequency=frequency,
        value=value,
    )


def _axis(direction: int) -> int:
    """Return the position of a direction's axis in AXES."""
    assert 1 <= abs(direction) <= len(AXES)
    return abs(direction) - 1


def _speed(record: dict[str, Any], number: int, findings: Findings) -> float:
    """Return the spindle speed [rpm] that the id lines state, 0 where they do not."""
    column = COLUMNS["spindle_speed"]
    for line in (record[key] for key in ID_LINES):
        if "spindle_speed" in line.lower():
            found = re.search(r"spindle_speed_rpm\s*=\s*([0-9]+\.?[0-9]*)(?![.,]?\w)", line)
            speed = float(found[1]) if found else math.nan
            if column.bounds.inside(np.array([speed])).all():
                return speed
            findings.add(f"record {number}: found {shown(line)}, allowed: {column.key}=N, {column.allowed}")
    return 0.0
