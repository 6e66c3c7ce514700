"""How Sphinx builds these pages: `python -m sphinx -W docs build/docs`."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "extensions"))
sys.path.insert(0, str(Path(__file__).parents[1]))

import hybridyn

project = "hybridyn"
copyright = "the hybridyn maintainers"
version = release = hybridyn.__version__

extensions = [
    "myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "command_reference", "finding_codes",
    "public_names",
]  # fmt: skip
myst_heading_anchors = 3

nb_execution_mode = "force"  # notebooks are committed without results
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 600

html_theme = "furo"
html_title = f"hybridyn {version}"
html_theme_options = {"light_css_variables": {"code-font-size": "75%"}}  # lines of help fit
html_show_copyright = False

default_role = "code"
pygments_style = "friendly"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_type_aliases = {
    name: name for name in ("Array", "ArrayLike", "Choice", "Index", "Mask", "Jacobians", "Gains")
}
autodoc_member_order = "bysource"
python_display_short_literal_types = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False  # what comes back is named in words, not by its type
