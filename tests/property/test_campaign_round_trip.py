"""Whatever a table may hold is read as it was written, in any of the ways in which tables are written."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from chatter_core.errors import InvalidInput
from chatter_core.evidence.columns import NO_WORD, Column
from chatter_core.evidence.measured import TABLES
from chatter_core.evidence.table import read_table
from chatter_core.units import si_factor

#: Separator and decimal mark that go together.
WRITINGS = [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ",")]
SETTINGS = settings(
    max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def cells(column: Column):
    """Return cells that a column may hold, with a point for a decimal mark."""
    bounds = column.bounds
    least, most = (bounds.gt if bounds.ge is None else bounds.ge), (bounds.lt if bounds.le is None else bounds.le)
    if column.choices:
        allowed = st.sampled_from(column.choices)
    elif column.whole:
        allowed = st.integers(int(least), int(most)).map(str)
    else:
        # More digits than 15 would be rounded on a bound.
        numbers = st.floats(least, most, exclude_min=bounds.ge is None, exclude_max=bounds.le is None)
        allowed = numbers.map(lambda number: f"{number:.15g}").filter(
            lambda cell: bool(bounds.inside(np.array([float(cell)]))[0])
        )
    return allowed | st.just("") if column.optional else allowed


def value(column: Column, cell: str) -> float:
    if column.choices:
        return column.choices.index(cell) if cell else NO_WORD
    return float(cell) * si_factor(column.key) if cell else np.nan


def written(table, rows, separator, mark, newline, encoding) -> bytes:
    numeric = [not column.choices for column in table.columns]
    lines = [[column.key for column in table.columns]]
    lines += [
        [cell.replace(".", mark) if number else cell for cell, number in zip(row, numeric, strict=True)] for row in rows
    ]
    return "".join(separator.join(line) + newline for line in lines).encode(encoding)


def said(path: Path, table) -> list[str]:
    """Return the findings of a file."""
    try:
        read_table(path, table)
    except InvalidInput as error:
        return error.problems
    return []


@SETTINGS
@given(data=st.data())
@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.file)
def test_what_is_written_is_read(table, data, tmp_path: Path):
    def known(row):
        return tuple(value(c, cell) for c, cell in zip(table.columns, row, strict=True) if c.key in table.identity)

    rows = data.draw(st.lists(st.tuples(*map(cells, table.columns)), min_size=1, max_size=8, unique_by=known))
    separator, mark = data.draw(st.sampled_from(WRITINGS))
    newline = data.draw(st.sampled_from(["\n", "\r\n"]))
    encoding = data.draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]))
    path = tmp_path / table.file
    path.write_bytes(written(table, rows, separator, mark, newline, encoding))
    read = read_table(path, table)
    for position, column in enumerate(table.columns):
        expected = [value(column, rows[line - 2][position]) for line in read.line]
        assert np.array_equal(read.columns[column.name], expected, equal_nan=True)
    order = np.column_stack([read.columns[c.name] for key in table.identity for c in table.columns if c.key == key])
    assert [tuple(row) for row in order] == sorted(tuple(row) for row in order)


@SETTINGS
@given(data=st.data())
@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.file)
def test_a_wrong_cell_is_told_at_its_line_and_column(table, data, tmp_path: Path):
    rows = data.draw(st.lists(st.tuples(*map(cells, table.columns)), min_size=1, max_size=8))
    line = data.draw(st.integers(0, len(rows) - 1))
    position = data.draw(st.integers(0, len(table.columns) - 1))
    # No number, no word of a column, and nothing that a separator or a quote would divide.
    wrong = data.draw(st.sampled_from(["?", "1e", "--1", "nan", "1.2.3", "0x10", "1_0", "½", "1 0", "9e99", "inf"]))
    rows[line] = (*rows[line][:position], wrong, *rows[line][position + 1 :])
    path = tmp_path / table.file
    path.write_bytes(written(table, rows, ",", ".", "\n", "utf-8"))
    with pytest.raises(InvalidInput) as caught:
        read_table(path, table)
    (problem,) = caught.value.problems
    assert problem.startswith(
        f"{path}, line {line + 2}, column {table.columns[position].key}: found '{wrong}', allowed: "
    )


@SETTINGS
@given(content=st.binary(max_size=200) | st.text(max_size=200).map(str.encode), with_header=st.booleans())
@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.file)
def test_any_content_is_read_or_refused(table, content, with_header, tmp_path: Path):
    path = tmp_path / table.file
    header = ",".join(column.key for column in table.columns).encode() + b"\n"
    path.write_bytes((header if with_header else b"") + content)
    assert all(problem.startswith(str(path)) for problem in said(path, table))
