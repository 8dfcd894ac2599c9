"""Every verb of the command line with its options and examples, as its help has them."""

from extension.tables import table
from pipeline.usage import meaning
from pipeline.verbs import VERBS
from pipeline.verbs.options import Options


def text() -> str:
    """Return a table of all verbs, the options that all have, and a section for each."""
    verbs = ([f"[`{verb}`](#{verb})", kind.summary()] for verb, kind in VERBS.items())
    common = f"\nEvery verb takes:\n\n{_options(Options, list(Options.fields()))}"
    return table(["verb", "what it does"], verbs) + common + "".join(_section(*item) for item in VERBS.items())


def _section(verb: str, kind: type[Options]) -> str:
    own = [name for name in kind.fields() if name not in Options.fields()]
    groups = f"\nAnd any of the groups {', '.join(f'`{name}`' for name in kind.groups)}.\n" if kind.groups else ""
    examples = "\n".join(f"python -m pipeline {example}" for example in kind.examples)
    explained = "\n".join(kind.explanation())
    return f"\n## {verb}\n\n{explained}\n\n{_options(kind, own)}{groups}\n```text\n{examples}\n```\n"


def _options(kind: type[Options], names: list[str]) -> str:
    """Return a table of some options of a verb."""
    rows = ([f"`{name}={kind.shape_of(name)}`", meaning(kind.fields()[name])] for name in names)
    return table(["option", "what it is"], rows)
