"""How far a study is: told from its store alone, before, while, and after it is computed."""

import json
import os
import socket
import subprocess
import time

import numpy as np
import pytest

from chatter_core.errors import InvalidInput
from chatter_core.variables import STATUS
from pipeline import status, store
from pipeline.command_line import main
from pipeline.places import LOCK, Folder
from tests.pipeline.studies import CELLS, CHUNKS, sweep


def files(folder):
    """Files of the status chunks, in the order of the chunks."""
    return sorted((folder / "lobes.zarr" / "status").glob("c.*"))


def written(folder, seconds):
    """Pretend that chunks were written at these times; the others were not."""
    for path in files(folder)[len(seconds) :]:
        path.unlink()
    for path, when in zip(files(folder), seconds, strict=True):
        os.utime(path, (when, when))


def held(folder, **said):
    """Pretend that a run on another host holds the folder, unless something else is said."""
    holder = {"pid": 1, "host": "elsewhere.invalid", "since": "2026-01-01T00:00:00+00:00", **said}
    (folder / LOCK).write_text(json.dumps(holder))


def test_a_whole_study_is_complete(tmp_path, capsys):
    sweep(tmp_path)
    found = status.progress(Folder(tmp_path))
    assert (found.state, found.cells, found.failed) == ("complete", {"ok": CELLS}, 0)
    capsys.readouterr()
    assert main(["status", f"output={tmp_path}"]) == 0
    assert f"cells:  {CELLS} of {CELLS} (100.0 %), {CELLS} ok" in capsys.readouterr().out


def test_rate_and_time_left_are_those_of_the_last_chunks(tmp_path, monkeypatch):
    sweep(tmp_path)
    # One an age ago, before an interruption, then one in 5 s: the age says nothing of the rate.
    written(tmp_path, [1e9, *(1e9 + 9e4 + 5.0 * np.arange(4))])
    held(tmp_path)
    monkeypatch.setattr("time.time", lambda: 1e9 + 9e4 + 21.0)
    found = status.progress(Folder(tmp_path))
    assert found.rate == pytest.approx(0.2)
    assert found.seconds_left == pytest.approx((CHUNKS - 5) / 0.2)
    assert found.state == "computing"
    assert found.cells == {"pending": CELLS * (CHUNKS - 5) // CHUNKS, "ok": CELLS * 5 // CHUNKS}
    told = status.text(found)
    assert "left:   35 s at this rate" in told
    assert "last:   a chunk 6 s ago" in told


def test_silence_is_an_interruption(tmp_path, monkeypatch):
    sweep(tmp_path)
    written(tmp_path, 1e9 + 5.0 * np.arange(4))
    held(tmp_path)
    monkeypatch.setattr("time.time", lambda: 1e9 + 15.0 + 119.0)
    assert status.progress(Folder(tmp_path)).state == "interrupted"
    monkeypatch.setattr("time.time", lambda: 1e9 + 15.0 + 99.0)
    assert status.progress(Folder(tmp_path)).state == "computing"


def test_a_run_that_has_ended_on_this_host_is_known_at_once(tmp_path):
    sweep(tmp_path)
    written(tmp_path, time.time() - np.arange(4.0)[::-1])
    place, here = Folder(tmp_path), socket.gethostname()
    # Given back in order.
    assert status.progress(place).state == "interrupted"
    ended = subprocess.Popen(["true"])
    ended.wait()
    held(tmp_path, pid=ended.pid, host=here)
    assert status.progress(place).state == "interrupted"
    held(tmp_path, pid=os.getpid(), host=here)
    assert status.progress(place).state == "computing"
    # The same number on another host is another process.
    held(tmp_path, pid=ended.pid)
    assert status.progress(place).state == "computing"
    (tmp_path / LOCK).write_text("half a li")
    assert status.progress(place).state == "computing"


def test_before_the_first_chunk_nothing_is_known(tmp_path):
    sweep(tmp_path)
    written(tmp_path, [])
    found = status.progress(Folder(tmp_path))
    assert (found.state, found.rate, found.seconds_left) == ("empty", None, None)
    assert status.document(found)["chunks_written"] == 0


def test_failed_cells_are_counted_and_told_by_the_exit_code(tmp_path, capsys):
    sweep(tmp_path)
    place = Folder(tmp_path)
    store.mark_chunk(place, store.chunks(store.open_group(place))[3], STATUS["worker_lost"])
    capsys.readouterr()
    assert main(["status", f"output={tmp_path}", "format=json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert (told["state"], told["cells_failed"], told["cells"]["worker_lost"]) == ("complete", 8, 8)


def test_a_damaged_chunk_is_pending(tmp_path):
    sweep(tmp_path)
    files(tmp_path)[2].write_bytes(b"not what was written")
    assert status.progress(Folder(tmp_path)).cells == {"pending": 8, "ok": CELLS - 8}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "output: missing"),
        (["output=nowhere"], "holds no lobes.zarr"),
        (["output=nowhere", "format=xml"], "format: found 'xml', allowed: one of 'text' or 'json'"),
        (["output=nowhere", "study=smoke"], "not for status"),
    ],
)
def test_bad_words_are_refused(words, said):
    with pytest.raises(InvalidInput, match=said):
        status.run(words)
