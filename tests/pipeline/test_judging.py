"""What ``compare``, ``diagnose`` and ``improve`` share: how an answer is written, and what it never replaces."""

import errno
import json
import os
import shutil
import signal
from pathlib import Path

import pytest
import yaml

from chatter_core.errors import InvalidInput
from pipeline.answer_folder import write_whole
from pipeline.command_line import Terminated, main
from pipeline.judging import DOCUMENTS
from pipeline.locking import locked

CAMPAIGNS = Path(__file__).parents[1] / "data" / "campaigns"
PAPER_CAMPAIGN = Path(__file__).parents[2] / "docs" / "examples" / "paper_campaign"
SERIAL = "cluster=serial"
#: Files of an answer to the campaign below.
DIAGNOSED = {"diagnosis.json", "power.csv", "report.html", "model.yaml", "figures/ranking.png", "figures/power.png"}
FILES = {
    "compare": {"comparison.json", "report.html", "model.yaml", "figures/pulls.png"},
    "diagnose": DIAGNOSED,
    "improve": DIAGNOSED | {"diagnosis_last.json", "history.csv", "figures/history.png"},
}
#: Those of which an answer to a campaign with cuts may have one, and an answer to this one has none.
OTHERS = {"compare": "trials.csv", "diagnose": "figures/lobes.png", "improve": "figures/receptances.png"}
#: That by which an answer of a verb is known.
MARKS = {"compare": "comparison.json", "diagnose": "diagnosis.json", "improve": "diagnosis.json"}
#: The least that an earlier answer to the campaign of these tests says.
EARLIER = json.dumps({"campaign": "quick"})
#: Columns of limiting depths.
LIMITS = "spindle_speed_rpm,limit_depth_mm,uncertainty_mm\n"
every_verb = pytest.mark.parametrize("verb", list(FILES))


@pytest.fixture
def quick(tmp_path):
    """A campaign that is judged in a second: one measured mode, and one that the machine has not."""
    campaign = tmp_path / "quick"
    campaign.mkdir()
    shutil.copy(CAMPAIGNS / "r01" / "machine.yaml", campaign)
    head = "spindle_speed_rpm,mode,natural_frequency_hz,damping_ratio\n"
    (campaign / "modes.csv").write_text(head + "0,1,147,0.004\n0,5,900,\n")
    return campaign


def refused(capsys, *words):
    assert main(list(words)) == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    return said


def files_in(folder):
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def test_more_modes_than_a_machine_has_are_refused_by_the_word_that_asks_for_them(tmp_path, capsys):
    output = tmp_path / "nothing"
    said = refused(capsys, "compare", f"campaign={PAPER_CAMPAIGN}", "modes=50", f"output={output}")
    assert said == "error: modes: found 50, allowed at most 20 for this spindle model\n"
    assert not output.exists()


@every_verb
def test_an_answer_takes_the_place_of_an_earlier_one_and_of_nothing_else(tmp_path, capsys, quick, verb):
    output = tmp_path / "out"
    (output / "figures").mkdir(parents=True)
    for name in ("report.html", OTHERS[verb], "notes.txt", ".writing-notes"):
        (output / name).write_text("earlier")
    (output / MARKS[verb]).write_text(EARLIER)
    # What a run has left that was killed while it wrote.
    (output / ".writing-abc" / "figures").mkdir(parents=True)
    # Of a mode that the machine has not there is no answer, and the exit code says so.
    assert main([verb, f"campaign={quick}", f"output={output}", SERIAL]) == 1
    assert "no answer for 1 data" in capsys.readouterr().err
    assert files_in(output) - {".lock"} == FILES[verb] | {"notes.txt", ".writing-notes"}
    assert (output / "notes.txt").read_text() == "earlier"
    assert (output / "report.html").read_text() != "earlier"
    assert yaml.safe_load((output / "model.yaml").read_text())["effects"] == {}
    # The same campaign may be asked again, and another one not.
    assert main([verb, f"campaign={quick}", f"output={output}", SERIAL]) == 1
    other = shutil.copytree(quick, tmp_path / "other")
    assert "holds the answer for campaign 'quick'" in refused(capsys, verb, f"campaign={other}", f"output={output}")


def test_what_has_no_answer_is_counted_in_document_and_page(tmp_path, quick):
    output = tmp_path / "out"
    main(["compare", f"campaign={quick}", f"output={output}", SERIAL])
    errors = json.loads((output / "comparison.json").read_text())["errors"]
    told = errors["natural_frequency"]["calibrated"]
    assert (told["count"], told["unanswered"], told["at_least"]) == (2, 1, False)
    # Ten deviations of half a percent.
    assert told["value"] >= 0.05 / 2**0.5
    page = (output / "report.html").read_text()
    assert "(2 data; without an answer, and counted as wrong: 1 as described, 1 calibrated)" in page
    assert "(1 data)" in page


def test_a_page_of_limit_depths_alone_speaks_of_no_judged_cuts(tmp_path, quick):
    (quick / "modes.csv").unlink()
    (quick / "limits.csv").write_text(LIMITS + "9000,0.5,0.1\n10000,0.5,0.1\n11000,0.5,0.1\n")
    assert main(["compare", f"campaign={quick}", f"output={tmp_path / 'out'}", SERIAL]) == 0
    page = (tmp_path / "out" / "report.html").read_text()
    for words in (
        "Measured: 3 limit depths",
        "Limit depths and the boundary of stability",
        "Limit depths as they were measured, with their standard uncertainty.",
        "Held out: the limit depths of each of 3 groups of speeds",
        "Limit depths off, root mean square of ln(measured / predicted): ",
    ):
        assert words in page
    assert "Cuts as they were judged" not in page


@every_verb
def test_a_model_that_is_given_is_named_and_known_by_what_it_was_fitted_to(tmp_path, capsys, quick, verb):
    fitted, output = tmp_path / "fitted", tmp_path / "out"
    main(["compare", f"campaign={quick}", f"output={fitted}", SERIAL])
    assert json.loads((fitted / "comparison.json").read_text())["model"] is None
    assert "The model to begin with" not in (fitted / "report.html").read_text()
    capsys.readouterr()
    model = fitted / "model.yaml"
    main([verb, f"campaign={quick}", f"model={model}", f"output={output}", SERIAL])
    said = capsys.readouterr().out
    again = "the model was fitted to all of these measurements without cutting already"
    assert again in said
    named = f"The model to begin with, as described, is that in {model}."
    assert named in said
    page = (output / "report.html").read_text()
    assert named in page
    assert (again in page) == (verb == "compare")
    assert json.loads((output / MARKS[verb]).read_text())["model"] == str(model)


@every_verb
@pytest.mark.parametrize("document", DOCUMENTS)
def test_an_answer_is_not_written_over_that_of_another_campaign(tmp_path, capsys, quick, verb, document):
    (tmp_path / document).write_text(json.dumps({"campaign": "r02"}))
    said = refused(capsys, verb, f"campaign={quick}", f"output={tmp_path}")
    assert "holds the answer for campaign 'r02'" in said


def test_an_answer_is_not_written_over_that_of_a_namesake(tmp_path, capsys, quick):
    output, namesake = tmp_path / "out", tmp_path / "elsewhere" / "quick"
    (quick / "limits.csv").write_text(LIMITS + "9000,1.0,0.1\n10000,1.0,0.1\n")
    main(["compare", f"campaign={quick}", f"output={output}", SERIAL])
    before = (output / "comparison.json").read_bytes()
    shutil.copytree(quick, namesake)
    (namesake / "limits.csv").write_text(LIMITS + "9000,1.1,0.1\n")
    words = ("compare", f"campaign={namesake}", f"output={output}", SERIAL)
    assert "another campaign that is called 'quick': it has none of these cuts" in refused(capsys, *words)
    assert (output / "comparison.json").read_bytes() == before
    # A campaign that has grown, or lost a row, is the same one.
    (namesake / "limits.csv").write_text(LIMITS + "9000,1.1,0.1\n10000,1.0,0.1\n")
    main(list(words))
    assert (output / "comparison.json").read_bytes() != before


@pytest.mark.parametrize(
    ("file", "row", "other", "why"),
    [
        ("modes.csv", "0,1,147,0.004\n0,5,900,", "0,1,148,0.004", "it has none of these measurements"),
        ("machine.yaml", "kt_mpa: 550", "kt_mpa: 560", "it has another machine, they differ in cutting.kt_mpa"),
    ],
)
def test_an_answer_is_not_written_over_that_of_a_namesake_without_cuts(tmp_path, capsys, quick, file, row, other, why):
    output, namesake = tmp_path / "out", tmp_path / "elsewhere" / "quick"
    words = ("compare", f"output={output}", SERIAL)
    main([*words, f"campaign={quick}"])
    before = (output / "comparison.json").read_bytes()
    shutil.copytree(quick, namesake)
    text = (namesake / file).read_text()
    assert row in text
    (namesake / file).write_text(text.replace(row, other))
    said = refused(capsys, *words, f"campaign={namesake}")
    assert f"another campaign that is called 'quick': {why}" in said
    assert (output / "comparison.json").read_bytes() == before


@every_verb
def test_cuts_too_slow_for_any_model_are_told_and_leave_the_verdict_as_it_is(tmp_path, capsys, quick, verb):
    (quick / "modes.csv").write_text("spindle_speed_rpm,mode,natural_frequency_hz,damping_ratio\n0,1,147,0.004\n")
    (quick / "stability.csv").write_text(
        "trial,spindle_speed_rpm,axial_depth_mm,outcome\n1,5,0.5,stable\n2,6,0.5,stable\n"
    )
    assert main([verb, f"campaign={quick}", f"output={tmp_path / 'out'}", SERIAL]) == 1
    said = "2 of 2 cuts say nothing, for none can be computed there, the first at 5 rpm: the spindle is so slow"
    document = json.loads((tmp_path / "out" / MARKS[verb]).read_text())
    fails = document["where_it_fails"]
    (told,) = fails["calibrated"] if verb == "compare" else fails
    assert told["text"].startswith(said)
    assert not told["counts"]
    assert document.get("verdict", "underpowered") == "underpowered"
    assert said in (tmp_path / "out" / "report.html").read_text()
    if verb != "improve":
        assert said in capsys.readouterr().out


@every_verb
def test_nothing_that_was_read_is_written_over(tmp_path, capsys, quick, verb):
    output = tmp_path / "out"
    main(["compare", f"campaign={quick}", f"output={output}", SERIAL])
    before = {path: path.read_bytes() for path in (*quick.iterdir(), output / "model.yaml")}
    words = (verb, f"campaign={quick}", f"model={output / 'model.yaml'}")
    assert "is the folder of the campaign itself" in refused(capsys, *words, f"output={quick}")
    assert "holds the model that is read" in refused(capsys, *words, f"output={output}")
    assert "output: is empty" in refused(capsys, *words, "output=")
    assert {path: path.read_bytes() for path in before} == before
    assert set(quick.iterdir()) < set(before)


@every_verb
def test_names_do_nothing_to_page_and_terminal(tmp_path, capsys, quick, verb):
    campaign = quick.rename(tmp_path / "<script> \x1b[31m $x_1$")
    (campaign / "a\x1b<i>.csv").write_text("")
    main([verb, f"campaign={campaign}", f"output={tmp_path / 'out'}", SERIAL])
    page = (tmp_path / "out" / "report.html").read_text()
    assert "&lt;script&gt;" in page
    assert "<i>" not in page
    assert "\x1b" not in page + capsys.readouterr().out


@every_verb
def test_what_cannot_be_written_leaves_what_was_there(tmp_path, capsys, monkeypatch, quick, verb):
    def full(*arguments, **options):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    words = [verb, f"campaign={quick}", SERIAL]
    monkeypatch.setattr("pipeline.model_file.write", full)
    new = tmp_path / "new" / "folder"
    assert main([*words, f"output={new}"]) == 2
    assert f"output: {new} cannot be written: No space left on device" in capsys.readouterr().err
    assert not new.parent.exists()
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "report.html").write_text("earlier")
    (tmp_path / "old" / MARKS[verb]).write_text(EARLIER)
    assert main([*words, f"output={tmp_path / 'old'}"]) == 2
    assert "No space left on device" in capsys.readouterr().err
    assert {path.name for path in (tmp_path / "old").iterdir()} == {".lock", "report.html", MARKS[verb]}
    assert (tmp_path / "old" / "report.html").read_text() == "earlier"
    assert (tmp_path / "old" / MARKS[verb]).read_text() == EARLIER


def test_a_diagnosis_in_the_place_of_a_diagnosis_leaves_what_is_called_as_a_history(tmp_path, quick):
    words = ["diagnose", f"campaign={quick}", f"output={tmp_path}", SERIAL]
    main(words)
    (tmp_path / "history.csv").write_text("mine")
    main(words)
    assert (tmp_path / "history.csv").read_text() == "mine"


def test_what_is_no_file_in_the_place_of_an_earlier_one_is_told_before_anything_is_moved(tmp_path):
    def write(folder):
        (folder / "one").write_text("new")
        return [folder / "one"]

    (tmp_path / "two").mkdir()
    with pytest.raises(InvalidInput, match="two is a folder, and a file of the answer is called so"):
        write_whole(write, tmp_path, ["two"])
    assert {path.name for path in tmp_path.iterdir()} == {"two"}


def test_a_folder_that_was_removed_during_the_run_is_made_again(tmp_path):
    def write(folder):
        (folder / "one").write_text("new")
        return [folder / "one"]

    assert [path.read_text() for path in write_whole(write, tmp_path / "gone" / "too")] == ["new"]


def test_where_a_folder_of_an_answer_finds_no_room_nothing_is_moved(tmp_path, monkeypatch):
    def write(folder):
        (folder / "figures").mkdir()
        paths = [folder / "one", folder / "figures" / "two"]
        for path in paths:
            path.write_text("new")
        return paths

    def full(path, *words, **named):
        if path == tmp_path / "figures":
            raise OSError(28, "No space left on device", str(path))
        return made(path, *words, **named)

    (tmp_path / "one").write_text("old")
    made = Path.mkdir
    monkeypatch.setattr(Path, "mkdir", full)
    with pytest.raises(OSError, match="No space left"):
        write_whole(write, tmp_path)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"one": "old"}


def test_a_signal_while_files_are_moved_waits_for_the_last(tmp_path, monkeypatch):
    def end(number, frame):
        raise Terminated(number)

    def write(folder):
        for name in ("one", "two"):
            (folder / name).write_text("new")
        return [folder / "one", folder / "two"]

    def terminated(path, target):
        move(path, target)
        signal.raise_signal(signal.SIGTERM)

    for name in ("one", "two", "three"):
        (tmp_path / name).write_text("old")
    before, move = signal.signal(signal.SIGTERM, end), Path.replace
    monkeypatch.setattr(Path, "replace", terminated)
    try:
        with pytest.raises(Terminated):
            write_whole(write, tmp_path, ["one", "three"])
    finally:
        signal.signal(signal.SIGTERM, before)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"one": "new", "two": "new"}


@every_verb
@pytest.mark.parametrize(
    ("held", "told"),
    [
        ("lobes.zarr/zarr.json", "is the folder of a study"),
        ("unpacked-dataset.zarr/zarr.json", "is the folder of a study"),
        ("object_store.txt", "is the folder of a study"),
        ("report.html", "holds a report.html that another verb has written"),
        ("model.yaml", "holds a model.yaml that no earlier answer has written"),
        ("figures", "is no folder, and a folder of the answer is called so"),
        ("model.yaml/notes.txt", "is a folder, and a file of the answer is called so"),
    ],
)
def test_what_is_no_answer_of_the_verb_is_left_alone(tmp_path, capsys, quick, verb, held, told):
    file = tmp_path / "out" / held
    file.parent.mkdir(parents=True)
    file.write_text("mine")
    assert told in refused(capsys, verb, f"campaign={quick}", f"output={tmp_path / 'out'}")
    assert files_in(tmp_path / "out") == {held}
    assert file.read_text() == "mine"


@every_verb
def test_answers_to_one_campaign_may_share_a_folder(tmp_path, capsys, quick, verb):
    output = tmp_path / "out"
    others = set().union(*(FILES[other] for other in {*FILES} - {verb}))
    for name in others:
        (output / name).parent.mkdir(parents=True, exist_ok=True)
        (output / name).write_text(json.dumps({"campaign": quick.name}))
    assert main([verb, f"campaign={quick}", f"output={output}", SERIAL]) == 1
    found = files_in(output)
    assert FILES[verb] | others & {*DOCUMENTS} <= found
    if MARKS[verb] == MARKS["improve"]:
        # A history of an improvement speaks of another model than the diagnosis that has taken its place.
        assert not (FILES["improve"] - FILES[verb]) & found


@every_verb
def test_an_answer_is_not_put_into_a_store_or_where_links_lead_in_a_circle(tmp_path, capsys, quick, verb):
    store, circle = tmp_path / "lobes.zarr", tmp_path / "circle"
    store.mkdir()
    circle.symlink_to(circle)
    assert "is the folder of a study" in refused(capsys, verb, f"campaign={quick}", f"output={store / 'tables'}")
    told = refused(capsys, verb, f"campaign={quick}", f"output={circle / 'out'}")
    assert "output: symbolic links lead in a circle" in told
    assert not list(store.iterdir())


@every_verb
def test_workers_that_cannot_be_started_are_told_of_and_nothing_stays(tmp_path, capsys, monkeypatch, quick, verb):
    def failing(**_):
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr("pipeline.cluster.LocalCluster", failing)
    assert main([verb, f"campaign={quick}", f"output={tmp_path / 'out'}", "cluster=local"]) == 1
    assert "cluster: the workers could not be started: Nanny failed to start." in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@every_verb
def test_a_folder_of_effects_that_is_none_is_refused_before_anything_is_begun(tmp_path, capsys, quick, verb):
    words = (verb, f"campaign={quick}", f"output={tmp_path / 'out'}", SERIAL)
    for folder in (quick / "machine.yaml", tmp_path / "nowhere"):
        assert "is not a folder" in refused(capsys, *words, f"effects_path={folder}")
    assert not (tmp_path / "out").exists()


@every_verb
def test_a_folder_in_use_is_left_alone(tmp_path, capsys, quick, verb):
    output = tmp_path / "out"
    output.mkdir()
    with locked(output):
        said = (output / "lock.json").read_text()
        for text in ("[]", "[" * 100_000):
            (output / "lock.json").write_text(text)
            assert main([verb, f"campaign={quick}", f"output={output}", SERIAL]) == 3
        assert "in use by another process" in capsys.readouterr().err
        (output / "lock.json").write_text(said)
        assert main([verb, f"campaign={quick}", f"output={output}", SERIAL]) == 3
        assert (output / "lock.json").exists()
    assert f"in use by process {os.getpid()}" in capsys.readouterr().err
