"""Sphinx settings: strict (``make docs`` turns warnings into errors) and offline (``offline.py``)."""

import importlib
import sys
from pathlib import Path

from stickslip import __version__

sys.path.insert(0, str(Path(__file__).parent))  # offline.py, gallery.py, law_table.py

project = "stickslip"
author = "The stickslip developers"
copyright = "The stickslip developers"
version = release = __version__

extensions = [
    "sphinx.ext.autodoc", "sphinx.ext.autosummary", "numpydoc", "myst_parser", "sphinx_gallery.gen_gallery", "offline",
]  # fmt: skip
exclude_patterns = ["_build", "_templates", "examples", "paper"]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "substitution"]
myst_substitutions = {"law_table": importlib.import_module("law_table").table()}
myst_heading_anchors = 3
autosummary_generate = True
autodoc_typehints = "none"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
nitpicky = False

sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",  # every example runs
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "image_scrapers": ("gallery.figures_of",),
    "capture_repr": (),
    "reset_modules": ("gallery.forget",),
    "download_all_examples": False,
    "show_memory": False,
    "min_reported_time": 1e9,
    "write_computation_times": False,
    "show_signature": False,
    "remove_config_comments": True,
}
suppress_warnings = ["config.cache"]  # the gallery's settings hold functions by name

templates_path = ["_templates"]
html_theme = "pydata_sphinx_theme"
html_math_renderer = "mathml"
html_title = "stickslip"
html_static_path = ["_static"]
html_css_files = ["stickslip.css"]
html_theme_options = {
    "navbar_end": ["theme-switcher"],
    "header_links_before_dropdown": 7,
    "show_prev_next": False,
    "use_edit_page_button": False,
    "footer_start": ["copyright"],
    "footer_end": [],
}
# pages without sections beside them
html_sidebars = dict.fromkeys(("index", "start", "tutorial", "commands", "real"), ())
html_show_sourcelink = False
