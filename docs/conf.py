"""Sphinx settings: strict (``make docs`` turns warnings into errors) and offline."""

from stickslip import __version__

project = "stickslip"
author = "The stickslip developers"
copyright = "The stickslip developers"
version = release = __version__

extensions = ["sphinx.ext.autodoc", "sphinx.ext.autosummary", "numpydoc", "myst_parser"]
exclude_patterns = ["_build"]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
autosummary_generate = True
autodoc_typehints = "none"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
nitpicky = False

html_theme = "pydata_sphinx_theme"
html_title = "stickslip"
html_theme_options = {"navbar_end": ["theme-switcher"], "show_prev_next": False, "use_edit_page_button": False}
html_show_sourcelink = False
