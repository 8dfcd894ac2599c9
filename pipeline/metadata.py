"""The root document of a store: attributes, and the description of every array in it, sealed by a checksum.

Chunks carry checksums of their own. A flipped bit in this document would be believed, so it has one too, and a copy
beside the store from which it is restored; what it says of the arrays restores their own documents.
"""

import json
import os
import zlib
from pathlib import Path
from typing import Any

#: Name of a document in a store, of the attribute that seals the root's, and of its copy beside the store.
DOCUMENT, SEAL, COPY = "zarr.json", "checksum", "metadata.json"


def attributes(path: Path) -> dict[str, Any]:
    """Return the attributes of a store as they are on the disk."""
    found: dict[str, Any] = json.loads((path / DOCUMENT).read_bytes())["attributes"]
    return found


def update(path: Path, **changes: Any) -> None:
    """Change attributes of a store, and seal it."""
    document = json.loads((path / DOCUMENT).read_bytes())
    document["attributes"] |= changes
    sealed = _sealed(document)
    # The copy comes second: a run that is killed between leaves an older one, which its seal shows to be whole.
    for file in (path / DOCUMENT, path.parent / COPY):
        _write(file, sealed)


def reseal(path: Path, **changes: Any) -> None:
    """Take the documents of the arrays as they are into the root of a store, change attributes, and seal it."""
    document = json.loads((path / DOCUMENT).read_bytes())
    for name in _described(document):
        _described(document)[name] = json.loads((path / name / DOCUMENT).read_bytes())
    document["attributes"] |= changes
    _write(path / DOCUMENT, _sealed(document))


def refresh_copy(path: Path) -> None:
    """Make the copy beside a store what the root is, after a run that was killed between the two."""
    copy = path.parent / COPY
    root = (path / DOCUMENT).read_bytes()
    if _intact(path / DOCUMENT) is not None and (not copy.exists() or copy.read_bytes() != root):
        _write(copy, root)


def problems(path: Path) -> dict[str, str]:
    """Return what is wrong with the documents of a store, by their place in it; nothing when all is well."""
    root = _intact(path / DOCUMENT)
    if root is None:
        return {DOCUMENT: "does not bear its checksum"}
    found = {}
    for name, expected in _described(root).items():
        file = path / name / DOCUMENT
        if not file.exists() or file.read_bytes() != _text(expected):
            found[f"{name}/{DOCUMENT}"] = "is not as the root describes it"
    return found


def restore(path: Path) -> list[str]:
    """Restore what is wrong with the documents of a store; return what could not be."""
    found = problems(path)
    if DOCUMENT in found:
        copy = _intact(path.parent / COPY)
        if copy is None:
            return [f"{path / DOCUMENT} is damaged, and so is its copy {path.parent / COPY}"]
        _write(path / DOCUMENT, _text(copy))
        found = problems(path)
    root = _intact(path / DOCUMENT)
    assert root is not None
    for place in found:
        file = path / place
        file.parent.mkdir(exist_ok=True)
        _write(file, _text(_described(root)[file.parent.name]))
    return []


def _described(root: dict[str, Any]) -> dict[str, Any]:
    """Return the document of every array, as the root has it."""
    found: dict[str, Any] = root["consolidated_metadata"]["metadata"]
    return found


def _intact(file: Path) -> dict[str, Any] | None:
    """Return a sealed document, None where it does not bear its seal."""
    try:
        text = file.read_bytes()
        document: dict[str, Any] = json.loads(text)
        return document if text == _sealed(document) else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _sealed(document: dict[str, Any]) -> bytes:
    """Return the text of a document with the checksum of all the rest of it."""
    rest = {**document, "attributes": {k: v for k, v in document["attributes"].items() if k != SEAL}}
    rest["attributes"][SEAL] = f"crc32:{zlib.crc32(_text(rest)):08x}"
    return _text(rest)


def _text(document: dict[str, Any]) -> bytes:
    return json.dumps(document, indent=2).encode()


def _write(file: Path, content: bytes) -> None:
    """Write a file whole or not at all."""
    partial = file.with_name(f"{file.name}.partial")
    try:
        partial.write_bytes(content)
        os.replace(partial, file)
    finally:
        partial.unlink(missing_ok=True)
