"""Units of the border: a key ends in its unit; inside, everything is SI and rad/s."""

import math

#: Suffix of a key -> (factor to SI, unit as CF metadata writes it).
SUFFIXES: dict[str, tuple[float, str]] = {
    "mm": (1e-3, "mm"),
    "um": (1e-6, "um"),
    "kg": (1.0, "kg"),
    "gpa": (1e9, "GPa"),
    "mpa": (1e6, "MPa"),
    "rad": (1.0, "rad"),
    "deg": (math.pi / 180.0, "degree"),
    "rpm": (2.0 * math.pi / 60.0, "rpm"),
    "hz": (2.0 * math.pi, "Hz"),
    "n": (1.0, "N"),
    "n_um": (1e6, "N/um"),
    "um_n": (1e-6, "um/N"),
    "urad_n_m": (1e-6, "urad/(N m)"),
    "n_m": (1.0, "N m"),
    "kg_m3": (1.0, "kg/m3"),
    "1_s": (1.0, "1/s"),
    "s": (1.0, "s"),
}


def split_key(key: str) -> tuple[str, str]:
    """Split a key of the border into its quantity and its unit suffix ("" where it has none).

    >>> split_key("stiffness_n_um")
    ('stiffness', 'n_um')
    """
    words = key.split("_")
    for first in range(1, len(words)):
        suffix = "_".join(words[first:])
        if suffix in SUFFIXES:
            return "_".join(words[:first]), suffix
    return key, ""


def si_factor(key: str) -> float:
    """Return what a value under this key is multiplied by to become SI (1 without a unit)."""
    suffix = split_key(key)[1]
    return SUFFIXES[suffix][0] if suffix else 1.0
