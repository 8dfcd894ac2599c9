"""What the site takes from the program itself: tables of settings, effects, verbs and results, and its docstrings."""

import re

from extension import campaign, effects, results, settings, verbs
from extension.docstrings import as_restructured_text

#: What stands in a page -> what writes the text that takes its place.
WRITTEN = {
    "verbs": verbs.text,
    "settings": settings.text,
    "effects": effects.text,
    "results": results.text,
    "campaign": campaign.text,
}
MARK = re.compile(r"^<!-- written from the program: (\w+) -->$", re.MULTILINE)


def setup(app):
    """Have pages and docstrings completed before Sphinx reads them."""
    app.connect("source-read", _complete)
    app.connect("autodoc-process-docstring", _linked)
    return {"parallel_read_safe": True}


def _complete(app, page, source):
    """Put what the program says in the place of each mark of a page."""
    source[0] = MARK.sub(lambda found: WRITTEN[found[1]](), source[0])


def _linked(app, what, name, member, options, lines):
    """Make a docstring's lines reStructuredText whose references to equations are links."""
    lines[:] = as_restructured_text("\n".join(lines)).splitlines()
