"""Settings of the documentation site: Sphinx, pages in Markdown, nothing fetched from a network."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

project = "Milling chatter"
html_title = project
language = "en"
extensions = ["myst_parser", "sphinx.ext.autodoc", "extension"]
exclude_patterns = ["examples", "extension"]

# Links to headings as the repository's pages write them.
myst_heading_anchors = 3
# Equations have primes and minus signs.
smartquotes = False
# Terminals and text diagrams stand in blocks without a language.
highlight_language = "none"

# Shapes and units, which docstrings give, say more than types of arrays do.
autodoc_typehints = "none"
autodoc_member_order = "bysource"
python_maximum_signature_line_length = 80

html_theme = "pydata_sphinx_theme"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_show_copyright = False
# Summaries are fetched, which a browser refuses to pages that lie in a folder.
html_show_search_summary = False
html_context = {"default_mode": "auto"}
html_theme_options = {
    "navbar_align": "left",
    "navigation_with_keys": False,
    "show_toc_level": 2,
    "footer_start": [],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
    "back_to_top_button": False,
}
