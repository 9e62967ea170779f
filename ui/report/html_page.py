"""A report as one HTML file that needs nothing else."""

from __future__ import annotations

import base64
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from palpate.ui.report.document import Document, numbered

_TEMPLATE = Path(__file__).with_name("page.html")


def html(document: Document) -> str:
    """The page, pictures inside."""
    # Whatever a case is called, it stays text.
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["data_uri"] = _data_uri
    environment.filters["kind"] = lambda block: type(block).__name__
    return environment.from_string(_TEMPLATE.read_text(encoding="utf-8")).render(document=numbered(document))


def _data_uri(path: Path) -> str:
    return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode("ascii")
