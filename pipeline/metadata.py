"""The root document of a store: attributes, and the description of every array in it, sealed by a checksum.

Chunks carry checksums of their own. A flipped bit in this document would be believed, so it has one too, and a copy
beside the store from which it is restored; what it says of the arrays restores their own documents.
"""

import json
import zlib
from typing import Any

from pipeline.errors import StoreUnavailable
from pipeline.json_text import parsed
from pipeline.places import Place
from pipeline.provenance import now

#: Name of a document in a store, of the attribute that seals the root's, and of its copy beside the store.
DOCUMENT, SEAL, COPY = "zarr.json", "checksum", "metadata.json"


def root_of(place: Place) -> str:
    """Return the key of the root document of a study's store."""
    return f"{place.root}/{DOCUMENT}"


def attributes(place: Place) -> dict[str, Any]:
    """Return the attributes of a store as they are in its place."""
    found: dict[str, Any] = json.loads(place.read(root_of(place)))["attributes"]
    return found


def update(place: Place, **changes: Any) -> None:
    """Change attributes of a store, and seal it."""
    document = json.loads(place.read(root_of(place)))
    document["attributes"] |= changes
    sealed = _sealed(document)
    # The copy comes second: a run that is killed between leaves an older one, which its seal shows to be whole.
    for key in (root_of(place), COPY):
        place.write(key, sealed)


def identity(place: Place) -> str:
    """Return what tells a store from every other that was in its place, and from itself before ``begin`` or a packing.

    Empty where there is none.
    """
    try:
        said = attributes(place)
    except FileNotFoundError:
        return ""
    fixed = (said.get(name) for name in ("fingerprint", "entries_per_chunk", "created", "packed"))
    return " ".join(map(str, (*fixed, len(said["history"]))))


def begin(place: Place, what: str) -> str:
    """Note in the history of a store what begins, and return its identity from then on.

    Tasks that were handed out before bear another one, and write nothing more.
    """
    update(place, complete=False, history=[*attributes(place)["history"], f"{now()} {what}"])
    return identity(place)


def reseal(place: Place, name: str, **changes: Any) -> None:
    """Take the documents of the arrays as they are into the root of a store, change attributes, and seal it.

    name: of the store in its place.
    """
    document = json.loads(place.read(f"{name}/{DOCUMENT}"))
    for array in _described(document):
        _described(document)[array] = json.loads(place.read(f"{name}/{array}/{DOCUMENT}"))
    document["attributes"] |= changes
    place.write(f"{name}/{DOCUMENT}", _sealed(document))


def refresh_copy(place: Place) -> None:
    """Make the copy beside a store what the root is, after a run that was killed between the two."""
    root = place.read(root_of(place))
    if _intact(root) is not None and _read(place, COPY) != root:
        place.write(COPY, root)


def copy_is_whole(place: Place) -> bool:
    """Return whether the copy beside a store bears its checksum; it may be that of the time before a run was killed."""
    return _intact(_read(place, COPY)) is not None


def problems(place: Place) -> dict[str, str]:
    """Return what is wrong with the documents of a store, by their place in it; nothing when all is well."""
    root = _intact(_read(place, root_of(place)))
    if root is None:
        return {DOCUMENT: "does not bear its checksum"}
    described = _described(root)
    texts = place.each(lambda name: _read(place, f"{place.root}/{name}/{DOCUMENT}"), described)
    return {
        f"{name}/{DOCUMENT}": "is not as the root describes it"
        for name, text in zip(described, texts, strict=True)
        if text != _text(described[name])
    }


def restore(place: Place) -> list[str]:
    """Restore what is wrong with the documents of a store; return what could not be."""
    found = problems(place)
    if DOCUMENT in found:
        copy = _intact(_read(place, COPY))
        if copy is None:
            return [f"{place.where(root_of(place))} is damaged, and so is its copy {place.where(COPY)}"]
        place.write(root_of(place), _text(copy))
        found = problems(place)
    root = _intact(_read(place, root_of(place)))
    assert root is not None
    for document in found:
        place.write(f"{place.root}/{document}", _text(_described(root)[document.partition("/")[0]]))
    return []


def _described(root: dict[str, Any]) -> dict[str, Any]:
    """Return the document of every array, as the root has it."""
    found: dict[str, Any] = root["consolidated_metadata"]["metadata"]
    return found


def _read(place: Place, key: str) -> bytes | None:
    """Return a document, None where there is none that can be read."""
    try:
        return place.read(key)
    except StoreUnavailable:
        raise
    except OSError:
        return None


def _intact(text: bytes | None) -> dict[str, Any] | None:
    """Return a sealed document, None where it does not bear its seal."""
    try:
        document: dict[str, Any] = parsed(text or b"")
        return document if text == _sealed(document) else None
    except (ValueError, KeyError, TypeError):
        return None


def _sealed(document: dict[str, Any]) -> bytes:
    """Return the text of a document with the checksum of all the rest of it."""
    rest = {**document, "attributes": {k: v for k, v in document["attributes"].items() if k != SEAL}}
    rest["attributes"][SEAL] = f"crc32:{zlib.crc32(_text(rest)):08x}"
    return _text(rest)


def _text(document: dict[str, Any]) -> bytes:
    return json.dumps(document, indent=2).encode()
