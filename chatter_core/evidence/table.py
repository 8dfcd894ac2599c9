"""Reading a measured table: a CSV file as people and spreadsheets write it, checked cell by cell.

Text is UTF-8, with or without a byte-order mark, or UTF-16 with one. Columns are separated by
commas, semicolons or tabs, as the header line shows; in the last two cases decimals may be written with a
comma, throughout. Left out are empty lines, lines that begin with #, and the empty cells that
end every line of some spreadsheets. Numbers carry no thousands separators and no units.

The file is read in blocks, each column of a block at once; a single cell is looked at only where
its column did not pass.
"""

import csv
import difflib
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chatter_core.errors import InvalidInput
from chatter_core.evidence.columns import NO_WORD, Column, Table
from chatter_core.evidence.findings import Findings, checked_file
from chatter_core.reading import shown
from chatter_core.units import si_factor, split_key

#: Lines that are held as text at a time.
BLOCK = 65536
#: Columns that a file may have.
MOST_COLUMNS = 200
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
AS_CSV = "save it as 'CSV UTF-8'"


@dataclass(frozen=True, kw_only=True)
class Rows:
    """Rows of a table, ascending in what identifies them.

    line: (row,) line of the file; columns: quantity -> (row,) values in SI, NaN where missing, or
    for words the position among the column's choices, NO_WORD where missing; unknown: column ->
    its cells as they stand in the file.
    """

    line: NDArray[np.intp]
    columns: dict[str, NDArray[np.float64]]
    unknown: dict[str, tuple[str, ...]]

    def __len__(self) -> int:
        return len(self.line)

    def codes(self, name: str) -> NDArray[np.int8]:
        """Return a column of words as positions among its choices."""
        return self.columns[name].astype(np.int8)

    def numbers(self, name: str) -> NDArray[np.int64]:
        """Return a column of whole numbers."""
        return self.columns[name].astype(np.int64)


@dataclass(frozen=True, kw_only=True)
class Header:
    """Header line. names: of the columns; width: cells of the line, with empty ones at its end; line: its number."""

    separator: str
    names: list[str]
    width: int
    line: int


class Decimals(NamedTuple):
    """The mark that a file's numbers are written with, "" where none has any, and the first cell that has it."""

    mark: str
    seen: str


def read_table(path: Path, table: Table) -> Rows:
    """Return the rows of a table's file.

    Raises InvalidInput with the findings, each naming file, line and column, what was found and
    what is allowed.
    """
    findings = Findings(path)
    text = _text(path)
    header = _header(text, table, findings)
    _check_header(header, table, findings)
    findings.raise_any()
    blocks, unknown = _blocks(text, header, table, findings)
    line = np.concatenate([block["line"] for block in blocks]).astype(np.intp)
    columns = {column.name: np.concatenate([block[column.name] for block in blocks]) for column in table.columns}
    order = np.lexsort([columns[split_key(key)[0]] for key in reversed(table.identity)])
    line, columns = line[order], {name: values[order] for name, values in columns.items()}
    _check_duplicates(line, columns, table, findings)
    findings.raise_any()
    return Rows(
        line=line,
        columns={column.name: columns[column.name] * si_factor(column.key) for column in table.columns},
        unknown={key: tuple(cells[row] for row in order) for key, cells in unknown.items()},
    )


def _text(path: Path) -> str:
    """Return a file's text."""
    content = checked_file(path).read_bytes()
    encoding = "utf-16" if content.startswith((b"\xff\xfe", b"\xfe\xff")) else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InvalidInput(
            [f"{path}, line {line}: no text in UTF-8 or UTF-16, byte {error.start} cannot be read; {AS_CSV}"]
        ) from None
    if "\0" in text:
        raise InvalidInput([f"{path}: holds binary data and not text; {AS_CSV}"])
    return text


def _header(text: str, table: Table, findings: Findings) -> Header:
    """Return the header, the first line that is not left out; raise InvalidInput where there is none."""
    numbered = enumerate(io.StringIO(text, newline=""), 1)
    number, line = next((pair for pair in numbered if not _is_left_out(pair[1])), (0, ""))
    if not line:
        wanted = ",".join(column.key for column in table.columns if not column.optional)
        findings.stop(f"is empty; needed: a header line {wanted} and a line for each measurement")
    bare = re.sub(r'"[^"]*"', "", line)
    found = [separator for separator in SEPARATORS if separator in bare]
    if len(found) > 1:
        words = " and by ".join(SEPARATORS[separator] for separator in found)
        findings.stop(f"columns are separated by {words}; use one of them throughout", line=number)
    separator = found[0] if found else ","
    try:
        names = [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]
    except csv.Error as error:
        findings.stop(f"cannot be read as cells: {error}", line=number)
    width = len(names)
    while names and not names[-1]:
        names.pop()
    if len(names) > MOST_COLUMNS:
        findings.stop(f"found {len(names)} columns, allowed: at most {MOST_COLUMNS}", line=number)
    return Header(separator=separator, names=names, width=width, line=number)


def _is_left_out(line: str) -> bool:
    # Spreadsheets name the separator in a line of its own.
    return not line.strip(" ,;\t\r\n") or line.startswith(("#", "sep="))


def _check_header(header: Header, table: Table, findings: Findings) -> None:
    """Add what is wrong with the names of the columns."""
    wanted = {column.key: column for column in table.columns}
    names, line = header.names, header.line
    explained = set()
    for position, name in enumerate(names):
        if not name:
            findings.add(f"the name of column {position + 1} is empty; name it or remove it", line=line)
        elif name in names[:position]:
            findings.add("stands twice; keep one of them", line=line, column=_shown_name(name))
        elif name not in wanted:
            meant = _meant(name, [column for key, column in wanted.items() if key not in names])
            if meant is not None:
                explained.add(meant.key)
                findings.add(_mistaken(meant), line=line, column=_shown_name(name))
    for key, column in wanted.items():
        if not column.optional and key not in names and key not in explained:
            findings.add(f"missing; needed: {column.doc}, {column.allowed}", line=line, column=key)


def _shown_name(name: str) -> str:
    """Return a column's name as messages show it, without what would upset a terminal."""
    return shown(name).strip("'")


def _meant(name: str, absent: list[Column]) -> Column | None:
    """Return the absent column that a name was probably meant for: same quantity, or nearly the same letters."""
    plain = re.sub(r"[^a-z0-9]+", "_", name.casefold()).strip("_")
    for column in absent:
        # Short words after the quantity are taken for a unit.
        if column.unit and re.fullmatch(rf"{column.name}(_[a-z0-9]{{1,4}})*", plain):
            return column
    close = difflib.get_close_matches(plain, [column.key for column in absent], n=1, cutoff=0.85)
    return next((column for column in absent if column.key in close), None)


def _mistaken(column: Column) -> str:
    unit = f"; values are in {column.unit}" if column.unit else ""
    return f"unknown name or unit; did you mean {column.key}?{unit}"


def _blocks(
    text: str, header: Header, table: Table, findings: Findings
) -> tuple[list[dict[str, NDArray[np.float64]]], dict[str, list[str]]]:
    """Return the columns block by block in the units of the file, and the cells of unknown columns."""
    wanted = {column.key for column in table.columns}
    unknown: dict[str, list[str]] = {key: [] for key in header.names if key not in wanted}
    blocks = [{name: np.empty(0) for name in ("line", *(column.name for column in table.columns))}]
    decimals = Decimals("." if header.separator == "," else "", "")
    for lines, rows in _rows(text, header, findings):
        cells = dict(zip(header.names, zip(*rows, strict=True), strict=True))
        decimals = decimals if decimals.mark else _decimals(cells, table)
        block = {"line": np.array(lines, dtype=np.float64)}
        for column in table.columns:
            found = cells.get(column.key)
            if found is None:
                block[column.name] = np.full(len(rows), NO_WORD if column.choices else np.nan)
            elif column.choices:
                block[column.name] = _words(found, column, lines, findings)
            else:
                block[column.name] = _numbers(found, column, decimals, lines, findings)
        blocks.append(block)
        for key, kept in unknown.items():
            kept.extend(cells[key])
    return blocks, unknown


def _rows(text: str, header: Header, findings: Findings) -> Iterator[tuple[Sequence[int], list[list[str]]]]:
    """Yield line numbers and rows of as many cells as the header has, block by block."""
    source = io.StringIO(text, newline="")
    lines = ("\n" if line.startswith("#") else line for line in islice(source, header.line, None))
    reader = csv.reader(lines, delimiter=header.separator, strict=True)
    width = len(header.names)
    empty = [""] * width
    while True:
        before = header.line + reader.line_num
        rows = _next_rows(reader, header.line, findings)
        if not rows:
            return
        numbers: Sequence[int] = range(before + 1, before + 1 + len(rows))
        if any(len(row) != width for row in rows) or empty in rows:
            numbers, rows = _tidy(rows, numbers, header, findings)
        if rows:
            yield numbers, rows


def _next_rows(reader: Any, first_line: int, findings: Findings) -> list[list[str]]:
    """Return the next block of rows; raise InvalidInput where quotes do not close within a line."""
    before = reader.line_num
    try:
        rows = list(islice(reader, BLOCK))
    except csv.Error as error:
        findings.stop(f"cannot be read as cells: {error}", line=first_line + reader.line_num)
    if reader.line_num - before != len(rows):
        row = next(row for row, cells in enumerate(rows) if any("\n" in cell or "\r" in cell for cell in cells))
        line = first_line + before + row + 1
        findings.stop("a quoted cell goes on in the next line; keep a cell in one line", line=line)
    return rows


def _tidy(
    rows: list[list[str]], numbers: Sequence[int], header: Header, findings: Findings
) -> tuple[list[int], list[list[str]]]:
    """Return the rows without empty ones and without empty cells at the end; others of wrong length are told."""
    width = len(header.names)
    kept_numbers, kept = [], []
    for number, row in zip(numbers, rows, strict=True):
        if not any(cell.strip() for cell in row):
            continue
        # No more empty cells than the header has at its end: elsewhere they betray a comma too many.
        if width < len(row) <= header.width and not any(cell.strip() for cell in row[width:]):
            row = row[:width]
        if len(row) != width:
            comma = header.separator == "," and len(row) > width
            hint = "; decimal commas need columns separated by semicolons" if comma else ""
            findings.add(f"found {len(row)} cells, allowed: {width}, as in the header{hint}", line=number)
            continue
        kept_numbers.append(number)
        kept.append(row)
    return kept_numbers, kept


def _decimals(cells: dict[str, tuple[str, ...]], table: Table) -> Decimals:
    """Return the first decimal mark in columns of numbers, and the cell that has it."""
    for column in table.columns:
        if not column.choices:
            for cell in cells.get(column.key, ()):
                if found := re.search("[.,]", cell):
                    return Decimals(found[0], cell.strip())
    return Decimals("", "")


def _words(cells: tuple[str, ...], column: Column, lines: Sequence[int], findings: Findings) -> NDArray[np.float64]:
    """Return the position of each cell's word among the column's choices."""
    code = {word: position for position, word in enumerate(column.choices)}
    if column.optional:
        code[""] = NO_WORD
    codes = [code.get(cell) for cell in cells]
    if None in codes:
        # Spreadsheets write words with a capital.
        codes = [code.get(cell.strip().lower()) for cell in cells]
        for cell, number, line in zip(cells, codes, lines, strict=True):
            if number is None:
                findings.add(f"found {shown(cell)}, allowed: {column.allowed}", line=line, column=column.key)
    return np.array([NO_WORD if number is None else number for number in codes], dtype=np.float64)


def _numbers(
    cells: tuple[str, ...], column: Column, decimals: Decimals, lines: Sequence[int], findings: Findings
) -> NDArray[np.float64]:
    """Return the cells' numbers, NaN where a cell is empty or is told as a finding."""
    mark = decimals.mark or "."
    values = _numbers_at_once(cells, mark)
    if values is None:
        values = np.array([_number(cell, mark) for cell in cells])
    wrong = ~column.bounds.inside(values)
    if column.whole:
        wrong |= values != np.floor(values)
    for row in np.flatnonzero(wrong):
        problem = _problem(cells[row], values[row], column, Decimals(mark, decimals.seen))
        if problem:
            values[row] = np.nan
            findings.add(problem, line=lines[int(row)], column=column.key)
    return values


def _numbers_at_once(cells: tuple[str, ...], mark: str) -> NDArray[np.float64] | None:
    """Return the numbers of plain cells, None where some cell needs a closer look."""
    joined = "".join(cells)
    other = "." if mark == "," else ","
    # float() would take underscores, digits of other scripts, nan and inf.
    if not joined.isascii() or "_" in joined or "n" in joined.lower() or other in joined:
        return None
    if mark == ",":
        cells = tuple(cell.replace(",", ".") for cell in cells)
    try:
        return np.array([float(cell) if cell else np.nan for cell in cells])
    except ValueError:
        return None


def _number(cell: str, mark: str) -> float:
    """Return the number in a cell, NaN where it holds none."""
    text = cell.strip()
    if not re.fullmatch(rf"[-+]?([0-9]+(\{mark}[0-9]*)?|\{mark}[0-9]+)([eE][-+]?[0-9]+)?", text):
        return np.nan
    return float(text.replace(mark, "."))


def _problem(cell: str, value: float, column: Column, decimals: Decimals) -> str | None:
    """Return what is wrong with a cell whose value is not allowed, None for one that may be empty."""
    text = cell.strip()
    if not text:
        return None if column.optional else f"is empty, needed: {column.allowed}"
    problem = f"found {shown(text)}, allowed: {column.allowed}"
    if not np.isnan(value):
        return problem
    if text.lower().lstrip("+-") in ("nan", "inf", "infinity", "na", "n/a", "none", "null", ""):
        return f"{problem}; a missing value is an empty cell, where one may be missing"
    if re.fullmatch(r"[-+0-9.,' eE]+", text):
        seen = f", as in {shown(decimals.seen)}," if decimals.seen else ""
        return (
            f"{problem}; decimals of this file are written with '{decimals.mark}'{seen} and thousands are not separated"
        )
    return problem


def _check_duplicates(
    line: NDArray[np.intp], columns: dict[str, NDArray[np.float64]], table: Table, findings: Findings
) -> None:
    """Add the rows that follow one of the same identity, in sorted rows."""
    if findings.count:
        # Cells that could not be read would count as different or alike by chance.
        return
    same = np.ones(max(len(line) - 1, 0), dtype=bool)
    for key in table.identity:
        values = columns[split_key(key)[0]]
        same &= values[1:] == values[:-1]
    what = " and ".join(filter(None, (", ".join(table.identity[:-1]), table.identity[-1])))
    for row in np.flatnonzero(same):
        # The sort is stable: the earlier line stands first.
        findings.add(f"same {what} as in line {line[row]}; keep one of them", line=int(line[row + 1]))
