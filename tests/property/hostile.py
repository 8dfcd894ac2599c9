"""Files as nobody means them: mutations of good ones, and pieces that readers are known to stumble over."""

import os
import tracemalloc
from collections.abc import Callable

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from chatter_core.errors import ChatterError, InvalidInput

#: How many mutated files are tried of each kind; more by the environment, as ``make fuzz`` does.
EXAMPLES = int(os.environ.get("FUZZ_EXAMPLES", "40"))
#: What reading may take for each byte of a file, beside what it takes anyway: text and numbers of a table several times
#: over [bytes].
MEMORY, MEMORY_A_BYTE = 32e6, 400.0
every_example = settings(
    max_examples=EXAMPLES,
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)

#: Pieces put into a file: numbers that are none or too large, marks of tables and of yaml, what would run code, paths
#: out of the folder, bytes of other encodings.
PIECES = [
    b"nan", b"-inf", b"1e400", b"99999999999999999999999", b"-1", b"0", b"0x10", b"1_000", b"1,5", b"", b" ",
    b",", b";", b"\t", b"\n", b"\r", b'"', b"'", b"#", b": ", b"- ", b"[", b"}", b"*a", b"&a ", b"? ", b"<<: ",
    b"true", b"null", b"~", b"!!python/object/apply:os.system [exit 1]", b"${oc.env:HOME}", b"../../../etc/passwd",
    b"/dev/zero", b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\xc3\xa9", b"\xe2\x80\xae", b"9" * 4000, b"[" * 2000,
]  # fmt: skip

Mutation = Callable[[bytes], bytes]


def problems_of(read: Callable[[], object]) -> list[str]:
    """Return what a reader has to say against what it is given, nothing where it reads it."""
    try:
        read()
    except InvalidInput as error:
        return list(error.problems)
    except ChatterError as error:
        return [str(error)]
    return []


def assert_read_or_told(read: Callable[[], object], size: int, memory: float = MEMORY) -> None:
    """Let a reader read so many bytes: what it says is in sentences, and it takes so much memory beyond theirs."""
    tracemalloc.start()
    problems = problems_of(read)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert all(problem.strip() and "Traceback" not in problem for problem in problems)
    assert most < memory + MEMORY_A_BYTE * size


def _spliced(piece: bytes, place: float, length: int) -> Mutation:
    """Put a piece in the place of so many bytes, at a share of the file's length."""

    def mutation(content: bytes) -> bytes:
        first = int(place * len(content))
        return content[:first] + piece + content[first + length :]

    return mutation


def _line_copied(source: float, target: float) -> Mutation:
    """Put a copy of one line before another."""

    def mutation(content: bytes) -> bytes:
        lines = content.split(b"\n")
        lines.insert(int(target * len(lines)), lines[int(source * (len(lines) - 1))])
        return b"\n".join(lines)

    return mutation


def _recoded(encoding: str) -> Mutation:
    """Write the text in another encoding."""
    return lambda content: content.decode("utf-8", "replace").encode(encoding, "replace")


def mutations() -> st.SearchStrategy[list[Mutation]]:
    """Return some mutations, one after the other."""
    share = st.floats(0.0, 1.0, allow_nan=False)
    pieces = st.one_of(st.sampled_from(PIECES), st.binary(max_size=3))
    one = st.one_of(
        st.builds(_spliced, pieces, share, st.integers(0, 12)),
        st.builds(_spliced, st.just(b""), share, st.integers(1, 400)),
        st.builds(_line_copied, share, share),
        st.builds(_recoded, st.sampled_from(["utf-16", "latin-1", "utf-8-sig", "cp037"])),
    )
    return st.lists(one, min_size=1, max_size=3)
