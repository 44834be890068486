"""The site: `make docs` builds it into build/site. Nothing is fetched while it is built or read."""

import os
import sys
from pathlib import Path

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS))

import pages  # noqa: E402  (beside this file)
import reports  # noqa: E402

import surehold  # noqa: E402

os.environ.setdefault("TERM", "dumb")

project = "surehold"
author = "The surehold project"
project_copyright = "The surehold project, Apache License 2.0"
version = release = surehold.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = [
    "generated/gallery/**/*.ipynb",
    "generated/gallery/**/*.py",
    "generated/cards.md",  # included
    "generated/pages/**",
    "**/sg_execution_times.rst",
    "sg_execution_times.rst",
]
suppress_warnings = ["ref.python"]  # a bare name such as "lower" is an attribute of several classes
templates_path = ["_templates"]

# --- pages -----------------------------------------------------------------------------------------------------------
myst_enable_extensions = ["attrs_block", "attrs_inline", "colon_fence", "deflist", "dollarmath", "substitution"]
myst_heading_anchors = 4
html_theme = "pydata_sphinx_theme"
html_title = f"surehold {version}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_extra_path = ["generated/pages"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "logo": {"text": "surehold"},
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "header_links_before_dropdown": 7,
    "show_prev_next": True,
    "show_toc_level": 2,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

# --- reference -------------------------------------------------------------------------------------------------------
autodoc_typehints = "signature"
maximum_signature_line_length = 80  # longer ones have a line for each parameter
toc_object_entries_show_parents = "hide"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
autosummary_generate = True
autosummary_generate_overwrite = True
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
default_role = "literal"  # one backtick in a docstring is code

# --- gallery: scripts that run while the site is built ---------------------------------------------------------------
sphinx_gallery_conf = {
    "examples_dirs": [str(DOCS.parent / "examples" / "gallery")],
    "gallery_dirs": ["generated/gallery"],
    "filename_pattern": r".*\.py$",
    "subsection_order": [f"../examples/gallery/{name}" for name in ("noise", "trials", "models", "grasps")],
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "image_scrapers": ("matplotlib",),
    "download_all_examples": False,
    "show_signature": False,
    "remove_config_comments": True,
    "write_computation_times": False,
    "plot_gallery": os.environ.get("SUREHOLD_GALLERY", "1") == "1",
}


def math_renderer(self, node: nodes.Element) -> None:
    """Write a formula as MathML, which browsers draw by themselves: no script, no fonts, no network."""
    block = isinstance(node, nodes.math_block)
    formula = tex2mathml(node.astext(), as_block=block)
    self.body.append(f'<div class="math">{formula}</div>' if block else formula)
    raise nodes.SkipNode


html_math_renderer = "mathml"


def keep_together(app: Sphinx, name: str, source: list[str]) -> None:
    """Break no line between a number and its error."""
    source[0] = source[0].replace(" ± ", "\u00a0±\u00a0")


def write(app: Sphinx, config: object) -> None:
    """Write the generated pages before any is read."""
    pages.write(DOCS / "generated")
    reports.write(DOCS / "generated")


def setup(app: Sphinx) -> None:
    """Add what Sphinx does not do by itself."""
    app.add_html_math_renderer("mathml", (math_renderer, None), (math_renderer, None))
    app.connect("config-inited", write)
    app.connect("source-read", keep_together)
