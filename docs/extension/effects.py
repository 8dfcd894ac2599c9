"""Every effect of the library: its law, parameters, choices and configured values."""

import inspect
from collections.abc import Iterator

from chatter_core.effects import Effect, Setting, effect_class, effect_names, variants
from extension.docstrings import as_markdown
from extension.tables import block, table
from pipeline.configuration import CONFIGS, EFFECTS


def text() -> str:
    """Return a table of all effects, and a section for each."""
    found = [effect_class(name) for name in effect_names()]
    rows = ([f"[`{effect.name()}`](#{effect.name()})", _stages(effect), _adds(effect)] for effect in found)
    return table(["effect", "changes the stage", "what it adds"], rows) + "".join(map(_section, found))


def _stages(effect: type[Effect]) -> str:
    """Return the stages that an effect's variants change."""
    return ", ".join(dict.fromkeys(f"`{one.acts_on}`" for one in variants(effect.name())))


def _adds(effect: type[Effect]) -> str:
    """Return the first line of an effect's file: what it adds, in words."""
    return as_markdown((inspect.getdoc(inspect.getmodule(effect)) or "").splitlines()[0])


def _section(effect: type[Effect]) -> str:
    parts = [f"\n## {effect.name()}\n", as_markdown(inspect.getdoc(effect) or ""), "\n", _parameters(effect)]
    if effect.settings:
        rows = ([f"`{one.name}`", one.doc, ", ".join(_choices(one))] for one in effect.settings)
        parts.append(table(["choice", "meaning", "allowed"], rows))
    values = (CONFIGS / EFFECTS / f"{effect.name()}.yaml").read_text(encoding="utf-8")
    return "\n".join([*parts, f"`configs/effects/{effect.name()}.yaml`\n", block(values, "yaml")])


def _choices(setting: Setting) -> Iterator[str]:
    """Yield what may be chosen, and what that leaves nothing to say."""
    for choice in setting.choices:
        unused = " and ".join(f"`{name}`" for name in setting.unused.get(choice, ()))
        yield f"`{choice}`" + (f" (without {unused})" if unused else "")


def _parameters(effect: type[Effect]) -> str:
    rows = (
        [f"`{one.name}`", one.doc, one.unit, f"{one.lower:g} to {one.upper:g}", f"{one.null:g}", f"{one.prior_width:g}"]
        for one in effect.declared
    )
    return table(["parameter", "meaning", "unit", "bounds", "no effect at", "width of its prior"], rows)
