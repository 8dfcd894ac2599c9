"""An empty campaign to fill in: the machine with every key explained, and a header line for each table.

All of it is written from the declarations that the reader checks against.
"""

from pathlib import Path
from typing import Any, get_origin

import yaml
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from chatter_core.errors import InvalidInput
from chatter_core.evidence.columns import Table, column_like
from chatter_core.evidence.measured import TABLES
from chatter_core.machine import MACHINE_FILE, Machine
from chatter_core.reading import inner_model
from pipeline.answer_folder import write_whole
from pipeline.configuration import compose_settings, sort_words, words_for
from pipeline.errors import told_where
from pipeline.locking import make_folder
from pipeline.telling import program, wrote
from pipeline.verbs.campaigns import TemplateOptions

HEAD = """# The machine as it is believed to be; measurements may say otherwise. The values are those of the reference
# machine: put your own in their place. A line that begins with # is a key that may be added, without its #.
# A machine has either bearing and spindle, or tip.
"""
README_HEAD = f"""A measurement campaign
======================

One folder for one machine with one tool and one workpiece material. machine.yaml is needed, and rows in one
at least of the other files; a file without rows may stay or be removed.
Run with:  {program()} point machine=machine.yaml spindle_speed_rpm=... axial_depth_mm=...

How tables are written
----------------------
The first line names the columns; their order is free, their names end in the unit. Further columns of your own
are kept, and not used. A missing value is an empty cell, where the column is optional.
Columns are separated by commas, or by semicolons or tabs; in the last two cases decimals may be written with a
comma, throughout the file. No thousands separators. Lines that begin with # and empty lines are left out.
Text is UTF-8 (in a spreadsheet: 'CSV UTF-8').
"""
README_END = """
*.uff, *.unv
------------
Frequency responses as universal files, dataset 58, instead of or beside frf.csv. All at one node, the tool tip;
directions +-1 (x) and +-2 (y). Displacement, velocity or acceleration over force, complex, over frequency in Hz,
in the units of dataset 164, or in SI without one. The spindle speed stands in one of the five id lines, as
spindle_speed_rpm=8000; without it the spindle is at rest.

What keys and columns mean, where they could be misread
-------------------------------------------------------
x is the feed direction. Positions and sections count from the tool tip. preload_n acts on every single bearing.
Receptances are displacement over force in fixed axes, with exp(+i w t): the imaginary part is negative at a
resonance. They are taken at the tool tip, before the trials.
A stable trial has no chatter frequency: one that is noted there is not used.
"""


def run(words: list[str]) -> int:
    """Write an empty campaign into a new folder; return the exit code."""
    sorted_words = words_for(TemplateOptions, words)
    if sorted_words.of_machine:
        raise InvalidInput(
            [f"{word}: not for template, which takes output=DIR alone" for word in sorted_words.of_machine]
        )
    output = TemplateOptions.read(sorted_words.options).output
    make_folder(output)
    if any(output.iterdir()):
        raise InvalidInput([f"output: {output} is not empty; name a new folder"])
    machine = compose_settings(sort_words([], ())).machine
    contents = {MACHINE_FILE: HEAD + "\n".join(_keys(Machine, machine.described(), "")) + "\n"}
    contents |= {table.file: ",".join(column.key for column in table.columns) + "\n" for table in TABLES}
    contents["README.txt"] = README_HEAD + "".join(_explained(table) for table in TABLES) + README_END
    with told_where(output):
        written = write_whole(lambda folder: _written(contents, folder), output)
    wrote(written)
    return 0


def _written(contents: dict[str, str], folder: Path) -> list[Path]:
    """Write files into a folder, and return their paths."""
    for name, text in contents.items():
        (folder / name).write_text(text, encoding="utf-8")
    return [folder / name for name in contents]


def _keys(model: type[BaseModel], values: dict[str, Any], indent: str) -> list[str]:
    """Return a description as commented yaml; keys without a value stand behind a #."""
    lines = []
    for name, field in model.model_fields.items():
        key, inner = field.alias or name, inner_model(field)
        meaning = f"  # {_meaning(model, name, field)}"
        if key not in values:
            lines += [f"{indent}# {line}" for line in (f"{key}:{meaning}", *_bare(inner, field))]
        elif inner is None:
            lines.append(f"{indent}{key}: {_flow(values[key])}{meaning}")
        elif isinstance(values[key], list):
            lines += _entries(inner, key, values[key], indent, meaning)
        else:
            lines += [f"{indent}{key}:{meaning}", *_keys(inner, values[key], indent + "  ")]
    return lines


def _bare(model: type[BaseModel] | None, field: FieldInfo) -> list[str]:
    """Return the keys of an absent description without their values; those of a list's entry after a dash."""
    if model is None:
        return []
    listed = get_origin(field.annotation) is tuple
    keys = [line.replace("# ", "", 1) for line in _keys(model, {}, "")]
    return [f"  {('- ' if row == 0 else '  ') if listed else ''}{key}" for row, key in enumerate(keys)]


def _entries(model: type[BaseModel], key: str, entries: list[Any], indent: str, meaning: str) -> list[str]:
    """Return a list as commented yaml: its first entry key by key, the others a line each."""
    if not entries:
        keys = ", ".join(field.alias or name for name, field in model.model_fields.items())
        return [f"{indent}{key}: []{meaning}; keys of each: {keys}"]
    first = _keys(model, entries[0], indent + "    ")
    first[0] = f"{indent}  - {first[0].lstrip()}"
    return [f"{indent}{key}:{meaning}", *first, *(f"{indent}  - {_flow(entry)}" for entry in entries[1:])]


def _meaning(model: type[BaseModel], name: str, field: FieldInfo) -> str:
    """Return meaning, range and default of a key."""
    column = column_like(model, name, field.description or "")
    words = [column.doc]
    if column.choices or str(column.bounds):
        words.append(column.allowed)
    if not field.is_required():
        default = f"{field.default:g}" if isinstance(field.default, float) else field.default
        words.append(f"{default} unless stated" if isinstance(default, (str, int)) else "may be left away")
    return "; ".join(words)


def _flow(value: Any) -> str:
    """Return a value as yaml in one line."""
    text = yaml.safe_dump(value, default_flow_style=True, sort_keys=False, width=10_000)
    return text.removesuffix("...\n").strip()


def _explained(table: Table) -> str:
    """Return what a table's file and columns mean."""
    width = max(len(column.key) for column in table.columns)
    lines = ["", table.file, "-" * len(table.file), f"{table.doc[0].upper()}{table.doc[1:]}."]
    lines.append(f"No two lines have the same {', '.join(table.identity)}.")
    for column in table.columns:
        optional = "; optional" if column.optional else ""
        lines.append(f"  {column.key:{width}}  {column.doc}; {column.allowed}{optional}")
    return "\n".join(lines) + "\n"
