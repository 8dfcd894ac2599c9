"""Every verb of the command line with its options, as the command line itself has them."""

from importlib import import_module

from extension.docstrings import as_markdown
from extension.tables import table
from pipeline.__main__ import OPTIONS, VERBS


def text() -> str:
    """Return a table of all verbs, and a section for each."""
    return table(["verb", "what it does"], ([f"[`{verb}`](#{verb})", doc] for verb, doc in VERBS.items())) + "".join(
        map(_section, VERBS)
    )


def _section(verb: str) -> str:
    doc = as_markdown(import_module(f"pipeline.{verb}").__doc__ or "")
    options = OPTIONS[verb]
    listed = f"As for [`{options[3:]}`](#{options[3:]})." if options.startswith("as ") else _options(options)
    return f"\n## {verb}\n\n{doc}\n\n{listed}\n"


def _options(options: str) -> str:
    """Return options as a list of code; a comma within brackets belongs to its option."""
    parts = options.replace(", ...", ",...").split(", ")
    return "Options: " + ", ".join(" or ".join(f"`{one}`" for one in part.split(" or ")) for part in parts) + "."
