"""Effects that restore what a base model was asked to leave out: where nothing was, they change nothing."""

from collections.abc import Mapping
from typing import Any

from pipeline.telling import remark


def remark_idle(
    effects: Mapping[str, Mapping[str, Any]],
    *,
    at_rest: bool,
    modes: int,
    rest: str = "base=static_bearing",
    count: str = "modes",
) -> None:
    """Tell which effects, each with its settings, find what they restore there already.

    at_rest: whether bearings stand still in any of the models, and rest: the word that asks for it; modes: of an axis
    that the one with the fewest keeps, and count: the key that asks for them.
    """
    if "speed_dependent_bearing" in effects and not at_rest:
        remark(
            f"remark: effects.speed_dependent_bearing changes nothing, since the bearings turn already; say {rest} "
            "where they are to stand still without it"
        )
    if "higher_modes" in effects and int(effects["higher_modes"]["modes"]) <= modes:
        restored = effects["higher_modes"]["modes"]
        remark(
            f"remark: effects.higher_modes changes nothing, since it restores up to {restored} modes of an axis and "
            f"{modes} are kept; say {count}=N with fewer, or effects.higher_modes.modes=N with more"
        )
