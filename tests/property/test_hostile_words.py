"""Whatever words stand on a command line: settings, or sentences; nothing hangs, and nothing takes much memory."""

from collections.abc import Iterator
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.command_line import VERBS, main
from pipeline.configuration import compose_settings, groups, words_for
from pipeline.verbs.studies import SweepOptions
from tests.property.hostile import EXAMPLES, PIECES, assert_read_or_told, every_example, problems_of

#: What composing and checking a study takes, axes of a million values included [bytes].
SETTINGS_BYTES = 150_000_000
#: Values as somebody may write them: of every type, too large, nested, with traps of yaml.
VALUES = [
    "1", "0", "-1", "0.5", "1e-300", "1e300", "1e400", "nan", "inf", "1000000", "99999999999999999999", "true", "null",
    "", "[]", "{}", "[1, 2, 3]", "[1, 1]", "[[1]]", "{a: 1}", "{start: 1, stop: 2, count: 1000000}", "x" * 300,
    "{start: 1e-9, stop: 1e12, count: 3, spacing: geometric}", "[dynamic, static]", "up", "local", "*a", "&a [*a]",
    "!!python/name:os.system", "${oc.env:HOME}", "2026-11-22", "1:30:00", "0o17", "1_000", "/dev/zero", ".", "..",
]  # fmt: skip


def keys(data: Any, prefix: str = "") -> Iterator[str]:
    """Yield the dotted key of everything that plain data holds."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield from keys(value, f"{prefix}.{key}".removeprefix("."))
    elif isinstance(data, list | tuple):
        for index, value in enumerate(data):
            yield from keys(value, f"{prefix}[{index}]")
    yield prefix


def known_keys() -> list[str]:
    found = compose_settings(words_for(SweepOptions, ["study=smoke", "effects=[process_damping]"]))
    data = {**found.machine.described(), **found.model_dump(mode="json", exclude={"machine"})}
    return sorted({key for key in keys(data) if "." in key} | {"spindle.sections[9].length_mm", "tip.modes[0].axis"})


def words() -> st.SearchStrategy[list[str]]:
    """Return some words: values of keys that there are, choices of groups, options, and what is none of them."""
    values = st.one_of(
        st.sampled_from(VALUES), st.sampled_from([piece.decode("latin-1") for piece in PIECES]), st.text(max_size=5)
    )
    names = st.one_of(
        st.sampled_from(known_keys()),
        st.sampled_from([*groups(), *SweepOptions.fields(), "machine"]),
        st.text(max_size=8),
    )
    choices = st.sampled_from([f"{group}={name}" for group, all_of in groups().items() for name in all_of])
    one = st.one_of(st.builds("{}={}".format, names, values), choices, st.text(max_size=8))
    # A word of a command line ends where a zero byte stands, and holds whole characters.
    return st.lists(one.map(lambda word: word.replace("\0", "").encode("utf-8", "ignore").decode()), max_size=4)


@settings(every_example, max_examples=max(1, EXAMPLES // 5))
@given(words())
def test_settings_or_sentences_come_of_any_words(found):
    assert_read_or_told(lambda: compose_settings(words_for(SweepOptions, ["study=smoke", *found])), 0, SETTINGS_BYTES)


@settings(every_example, max_examples=max(1, EXAMPLES // 5))
@given(verb=st.sampled_from([*VERBS, "nonsense"]), found=words())
def test_any_verb_tells_words_that_it_does_not_take_and_ends_with_two(capsys, verb, found):
    # Of a verb that takes a campaign there is none, so nothing is computed; sweeps and points are where words are good.
    if verb in ("sweep", "point", "paper", "template") and not problems_of(lambda: words_for(SweepOptions, found)):
        return
    capsys.readouterr()
    assert main([verb, *found, "nonsense"]) == 2
    told = capsys.readouterr()
    assert told.err.startswith("error: ")
    assert all(line.startswith("error: ") for line in told.err.splitlines())
    assert "Traceback" not in told.err


@settings(every_example, max_examples=max(1, EXAMPLES // 15))
@given(found=words())
def test_a_point_is_computed_or_told(capsys, found):
    point = ["point", "spindle_speed_rpm=6000", "axial_depth_mm=1"]
    # A point writes a file where it is asked to, and beside that it takes what a study takes.
    kept = [word for word in found if not word.startswith(("output", "store"))]
    capsys.readouterr()
    code = main([*point, *kept])
    assert code in (0, 1, 2)
    assert "Traceback" not in capsys.readouterr().err
