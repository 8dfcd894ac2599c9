"""What is wrong with an object store is told in one line."""

import sys
from pathlib import Path

import pytest

from pipeline.command_line import main
from pipeline.places import Place
from tests.object_server.server import SECRET, USER
from tests.pipeline.object_store.server_side import SHORT, STORE


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["store=s3://lab"], "store: found 's3://lab', allowed: s3://BUCKET/PREFIX; a folder of this machine is named"),
        (["store=lab/first"], "store: found 'lab/first', allowed: s3://BUCKET/PREFIX"),
        (["store=s3://lab/../first"], "store: found 's3://lab/../first', allowed: s3://BUCKET/PREFIX"),
        ([f"store=s3://{USER}:{SECRET}@lab/first"], "store: found an address with credentials, allowed: s3://BUCKET"),
        ([STORE, "lease_s=soon"], "lease_s: found 'soon', allowed: 3 to 86400"),
        (["lease_s=60"], "lease_s: for object stores alone"),
        (["store=s3://elsewhere/first", SHORT], "s3://elsewhere/first: there is no such bucket at http://127.0.0.1:"),
        (["store=s3://lab/machines"], "holds files that are no study"),
        ([STORE, "output={used}"], "holds files that do not belong to s3://lab/machines/first"),
        ([STORE, "output={other}"], "belongs to the store s3://lab/other, not to s3://lab/machines/first"),
    ],
)
def test_what_cannot_be_meant_is_told_in_one_line(
    place: Place, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    folders = {"used": tmp_path / "used", "other": tmp_path / "other"}
    for folder in folders.values():
        folder.mkdir()
    (folders["used"] / "thesis.tex").write_text("years of work")
    (folders["other"] / "object_store.txt").write_text("s3://lab/other\n")
    place.write("first/notes.txt", b"years of work")
    words = [word.format(**folders) for word in words]
    if not any(word.startswith("output=") for word in words):
        words.append(f"output={tmp_path / 'new'}")
    assert_told_in_one_line(["sweep", "study=smoke", *words], said, capsys)
    assert not (tmp_path / "new").exists()


def assert_told_in_one_line(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.startswith("error: ")
    assert told.count("\n") == 1
    assert SECRET not in told


@pytest.mark.parametrize("verb", ["sweep", "status"])
@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (
            {"AWS_ACCESS_KEY_ID": "nobody"},
            "refuses the credentials of the environment (AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY): InvalidAccessKeyId",
        ),
        ({"AWS_ACCESS_KEY_ID": None, "AWS_SECRET_ACCESS_KEY": None}, "; AWS_ACCESS_KEY_ID is not set: "),
        # Nothing listens on the port of discarded data.
        (
            {"AWS_ENDPOINT_URL": f"http://{USER}:{SECRET}@127.0.0.1:9"},
            "http://127.0.0.1:9 (AWS_ENDPOINT_URL) cannot",
        ),
        ({"AWS_ENDPOINT_URL": "lab.example"}, "AWS_ENDPOINT_URL: found 'lab.example', allowed: https://HOST or"),
    ],
    ids=["refused", "none", "unreachable", "no address"],
)
def test_an_object_store_that_cannot_be_used_is_told_in_one_line(
    endpoint: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    verb: str,
    changed: dict[str, str | None],
    said: str,
) -> None:
    for name, value in changed.items():
        if value is None:
            monkeypatch.delenv(name)
        else:
            monkeypatch.setenv(name, value)
    study = ["study=smoke"] if verb == "sweep" else []
    assert_told_in_one_line([verb, *study, STORE, SHORT, f"output={tmp_path / 'new'}"], said, capsys)
    assert not (tmp_path / "new").exists()


def test_without_the_library_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    of_the_library = [name for name in sys.modules if name.startswith("obstore")]
    for name in [*of_the_library, *(f"pipeline.places.{module}" for module in ("objects", "lease", "s3"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "obstore", None)
    said = "store: object stores need the extra s3; in the program's folder: python -m pip install"
    assert_told_in_one_line(["sweep", "study=smoke", STORE], said, capsys)
