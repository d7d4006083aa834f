"""Sphinx configuration of the site."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

project = "kbvh"
copyright = "the kbvh authors, MIT licence"  # noqa: A001
extensions = ["myst_parser", "furo_from_debian"]
source_suffix = {".md": "markdown"}
master_doc = "index"
html_theme = "furo"
html_title = "kbvh"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = [("comparison.js", {"defer": "defer"})]
html_show_sphinx = False
html_copy_source = False
myst_heading_anchors = 3
myst_enable_extensions = ["deflist", "colon_fence"]
# Pages in GitHub's style may skip levels of headings.
suppress_warnings = ["myst.header"]
nitpicky = True
# Blocks without a language are commands and their output.
highlight_language = "none"
