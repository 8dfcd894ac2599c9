"""Files as nobody means them: mutations of good ones, and pieces that readers are known to stumble over."""

from collections.abc import Callable

from hypothesis import strategies as st

#: Pieces put into a file: numbers that are none or too large, marks of tables and of yaml, what would run code, paths
#: out of the folder, bytes of other encodings.
PIECES = [
    b"nan", b"-inf", b"1e400", b"99999999999999999999999", b"-1", b"0", b"0x10", b"1_000", b"1,5", b"", b" ",
    b",", b";", b"\t", b"\n", b"\r", b'"', b"'", b"#", b": ", b"- ", b"[", b"}", b"*a", b"&a ", b"? ", b"<<: ",
    b"true", b"null", b"~", b"!!python/object/apply:os.system [exit 1]", b"${oc.env:HOME}", b"../../../etc/passwd",
    b"/dev/zero", b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\xc3\xa9", b"\xe2\x80\xae", b"9" * 4000, b"[" * 2000,
]  # fmt: skip

Mutation = Callable[[bytes], bytes]


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
