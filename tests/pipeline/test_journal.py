"""The journal of a study in sentences: what a person asks who finds a study in the morning."""

import json

from pipeline.command_line import main
from pipeline.journal import FILE, Journal, read, sentences
from tests.pipeline.studies import sweep


def place(event):
    return f"chunk {event['outer']} {event['speeds']}"


def chunk(time, *, counts, **more):
    return {"time": time, "event": "chunk", "outer": [1, 0, 1], "speeds": [2, 4], "counts": counts, **more}


def test_chunks_in_a_row_are_one_line_and_what_failed_is_told_by_place_and_reason():
    good = [chunk(f"2026-01-02T03:04:0{second}+00:00", counts={"ok": 8}) for second in (5, 6, 7)]
    bad = chunk(
        "2026-01-02T03:04:08+00:00", counts={"ok": 4, "timed_out": 4}, errors=["Traceback\n  ...\nValueError: no"]
    )
    assert list(sentences([*good, bad, good[0]], 0, place)) == [
        "2026-01-02 03:04:05 to 2026-01-02 03:04:07  3 chunks computed, 24 cells",
        "2026-01-02 03:04:08  chunk [1, 0, 1] [2, 4]: 4 ok, 4 timed out\n    ValueError: no",
        "2026-01-02 03:04:05  1 chunk computed, 8 cells",
    ]


def test_half_a_line_is_no_event_and_is_told(tmp_path):
    Journal(tmp_path).write("stopped", signal="SIGTERM")
    with (tmp_path / FILE).open("a") as file:
        file.write('{"time": "2026-')
    events, torn = read(tmp_path / FILE)
    told = list(sentences(events, torn, place))
    assert told[0].endswith("  stopped by SIGTERM")
    assert told[1] == "lines that could not be read: 1; a run was killed while it wrote"


def test_a_study_with_failures_tells_its_runs_from_the_first_to_the_last(tmp_path, capsys):
    assert sweep(tmp_path / "study", "cluster=threads", kernel="without_equilibrium") == 1
    capsys.readouterr()
    assert main(["journal", f"output={tmp_path / 'study'}"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert "  begun by process " in told[0]
    assert "  workers: threads, to be watched at http://127.0.0.1:" in told[1]
    assert any(", 200 N, mode 1 alone, 8000 to " in line and "outside validity" in line for line in told)
    assert "  ended: " in told[-1]
    start = json.loads((tmp_path / "study" / FILE).read_text().splitlines()[0])
    assert told[0].startswith(start["time"][:10])


def test_of_a_mode_that_is_alone_that_is_told(tmp_path, capsys):
    assert sweep(tmp_path / "study", "grid.mode_selection=only", kernel="without_equilibrium") == 1
    capsys.readouterr()
    assert main(["journal", f"output={tmp_path / 'study'}"]) == 0
    told = capsys.readouterr().out
    assert ", 200 N, mode 2 alone, 8000 to " in told
    assert "modes" not in told


def test_a_damaged_study_or_one_without_a_journal_is_told(tmp_path, capsys):
    assert sweep(tmp_path / "study") == 0
    root = tmp_path / "study" / "lobes.zarr" / "zarr.json"
    whole = root.read_bytes()
    root.write_bytes(whole[:100])
    capsys.readouterr()
    assert main(["journal", f"output={tmp_path / 'study'}"]) == 2
    assert "zarr.json does not bear its checksum; restored by: " in capsys.readouterr().err
    root.write_bytes(whole)
    (tmp_path / "study" / FILE).unlink()
    assert main(["journal", f"output={tmp_path / 'study'}"]) == 2
    assert "there is no journal" in capsys.readouterr().err
