"""The pages of this folder, and some beside it, as a site: `make docs` writes it to build/docs.

The source is the whole repository, so that links are the same in the site and beside it.  Nothing
comes from the network, neither while it is built nor when it is read.
"""

import re
from itertools import groupby
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert

import softehl

project = "softehl"
author = "softehl developers"
copyright = "softehl developers, BSD-3-Clause"
version = release = softehl.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton"]
root_doc = "docs/index"
include_patterns = [
    "docs/*.md",
    "docs/gallery/*.md",
    "docs/validation/*.md",
    "benchmarks/README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
]
exclude_patterns = [".*", "build", "cases", "codegen", "results", "runtime", "src", "tests"]
default_role = "literal"
nitpicky = True
nitpick_ignore_regex = [("py:.*", ".*")]
suppress_warnings = ["ref.python"]  # attributes of one name in several classes
"""Types of other packages have no page here; links in the text are checked by MyST."""

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
html_math_renderer = "mathml"
myst_links_external_new_tab = True

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # docstrings say shapes and units; types of arrays say less, at length
python_maximum_signature_line_length = 88
autodoc_class_signature = "mixed"
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
smartquotes = False

html_theme = "furo"
html_title = f"softehl {release}"
html_static_path = ["_static"]
html_css_files = ["formulas.css"]
html_copy_source = False
copybutton_prompt_text = "$ "
html_theme_options = {"navigation_with_keys": True, "top_of_page_buttons": []}

_MARKUP = re.compile(r"(``?[^`]*``?|:\w+:`[^`]*`)|([|*_\\])")


def _escaped(match: re.Match[str]) -> str:
    return match[1] or "\\" + match[2]


def _plain(paragraph: list[str]) -> list[str]:
    """The lines of a paragraph as reStructuredText: code, a list of `name: meaning`, or prose."""
    if paragraph[0].startswith(" "):  # nothing but indented lines: a formula, code
        return ["::", "", *("    " + line for line in paragraph)]
    escaped = [_MARKUP.sub(_escaped, line) for line in paragraph]
    if any(line.startswith(" ") for line in escaped) and not escaped[0].startswith("- "):
        return [f"  {line.strip()}" if line.startswith(" ") else f"* {line}" for line in escaped]
    return escaped


def _as_plain_text(
    app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:
    """Docstrings are plain text with `code`: |U| and h* in them are no markup.

    Napoleon follows: it reads the sections of numpydoc, whose lines keep their indentation.
    """
    rules = [n for n, line in enumerate(lines) if re.fullmatch("-{3,}", line)]
    prose = lines[: rules[0] - 1] if rules else lines
    result: list[str] = []
    for blank, paragraph in groupby(prose, key=lambda line: not line.strip()):
        result += [""] if blank else _plain(list(paragraph))
    sections = (_MARKUP.sub(_escaped, line) for line in lines[len(prose) :])
    lines[:] = [*result, *sections]


def _inline(writer: Any, node: nodes.math) -> None:
    writer.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _display(writer: Any, node: nodes.math_block) -> None:
    writer.body.append(convert(node.astext(), display="block"))
    raise nodes.SkipNode


def setup(app: Any) -> None:
    """Sphinx calls this; formulas become MathML here, so that no script draws them."""
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
    app.connect("autodoc-process-docstring", _as_plain_text, priority=100)
