"""Kinds of studies: sweeps and data sets. What runs, keeps, checks and packs them asks a kind and not which it is."""

from pipeline.kinds.dataset import Dataset
from pipeline.kinds.kind import Computed, Kind, joined
from pipeline.kinds.lobes import KERNEL, Lobes
from pipeline.places import Place

#: By the names of their stores.
KINDS: dict[str, Kind] = {kind.name: kind for kind in (Lobes(), Dataset())}


def kind_of(place: Place) -> Kind:
    """Return the kind of the study in a place."""
    return KINDS[place.root]


__all__ = ["KERNEL", "KINDS", "Computed", "Dataset", "Kind", "Lobes", "joined", "kind_of"]
