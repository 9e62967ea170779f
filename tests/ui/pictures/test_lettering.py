"""Letters of the report's pictures, measured on the figures as they are drawn: nine points on paper, also of a picture made smaller."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from map_arrays import map_arrays
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from phantoms import affine, labels, marked_ct
from pypdf import PdfReader

from palpate.ui.pictures import gap_pictures, map_planes, slices, solids
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.lettering import LEAST_POINTS, PAGE_INCHES, SMALLEST
from palpate.ui.pictures.published_scale import Row, published_scale
from palpate.ui.report import document as doc
from palpate.ui.report import pdf
from palpate.ui.report.html_page import html


def images() -> CaseImages:
    return CaseImages(labels(affine()), labels(affine(), push_mm=3.0), marked_ct(affine()), {1: 120.0, 2: 40.0})


def anatomy() -> Figure:
    figure = Figure(figsize=(PAGE_INCHES, 2.5), layout="constrained")
    for axes in figure.subplots(1, 4):
        solids._show(axes, np.zeros((50, 50, 3), dtype=np.uint8), solids.RIGHT, 60.0, 15)
    return figure


def residuals() -> Figure:
    points = np.random.default_rng(1).normal(size=(60, 3)) * 10.0
    maps = {"points": points, "normals": points / 10.0, "standardised": points[:, 0]}
    return gap_pictures.residual_views(maps)


DRAWN: dict[str, Callable[[], Figure]] = {
    "planes": lambda: slices.stiffness_planes(images()), "series": lambda: slices.stiffness_series(images()),
    "deformation": lambda: slices.deformation_planes(images()), "map": lambda: map_planes.map_planes(images(), map_arrays(True)),
    "3D": anatomy, "gap": residuals,
    "published": lambda: published_scale([Row("here: left half", 20.0, (10.0, 40.0), found=True), Row("cancer [2]", 19.3)]),
}  # fmt: skip


@pytest.mark.parametrize("name", DRAWN)
def test_letters_are_large_enough_and_titles_do_not_run_into_each_other(name: str) -> None:
    figure = DRAWN[name]()
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    unseen = {t for axes in figure.axes if not axes.axison for t in (*axes.get_xticklabels(), *axes.get_yticklabels())}
    written = [
        text for text in figure.findobj(Text) if text.get_text().strip() and text.get_visible() and text not in unseen
    ]  # type: ignore[arg-type]
    assert written and min(text.get_fontsize() for text in written) * SMALLEST >= LEAST_POINTS
    assert figure.get_figwidth() <= PAGE_INCHES, "drawn wider than the page, letters would shrink with it"
    ticks = {
        t for axes in figure.axes for t in (*axes.get_xticklabels(), *axes.get_yticklabels())
    }  # some lie beyond their axis
    for text in (one for one in written if one not in ticks):
        box = text.get_window_extent(canvas.get_renderer())
        assert figure.bbox.y0 <= box.y0 and box.y1 <= figure.bbox.y1, f"{text.get_text()!r} is cut off"
    titles = [axes.title.get_window_extent(canvas.get_renderer()) for axes in figure.axes if axes.get_title()]
    rows = {round(box.y0) for box in titles}
    for row in rows:
        side_by_side = sorted((box for box in titles if round(box.y0) == row), key=lambda box: box.x0)
        assert all(a.x1 < b.x0 for a, b in pairwise(side_by_side)), "titles overlap"


def test_the_page_is_as_wide_as_the_pictures_are_drawn() -> None:
    assert pytest.approx(PAGE_INCHES, abs=0.01) == pdf._WIDTH / 72.0


def test_figures_are_numbered_alike_in_page_and_pdf(tmp_path: Path) -> None:
    slices.save(published_scale([Row("cancer [2]", 19.3)]), tmp_path / "a.png")
    picture = doc.Picture(tmp_path / "a.png", "The search.", "A curve.", 0.6)
    turns = doc.Interactive("<p>turns</p>", "A view that turns.")
    document = doc.Document("T", "c", [doc.Section("One", [picture]), doc.Section("Two", [turns, picture])])
    page = html(document)
    text = " ".join(p.extract_text() for p in PdfReader(pdf.write_pdf(document, tmp_path / "x.pdf")).pages)
    for said in (page, text):
        assert (
            said.count("Figure 1. The search.") == said.count("Figure 2. The search.") == 1 and "Figure 3" not in said
        )
    assert "A view that turns." in page


def test_text_of_the_pdf_is_nine_points_but_for_its_footer(tmp_path: Path) -> None:
    blocks = [
        doc.Paragraph("note", "small"),
        doc.Paragraph("text"),
        doc.Table(("a", "b"), [("1", "2")], "caption"),
        doc.Bullets(["item"]),
    ]
    document = doc.Document("T", "case", [doc.Section("One", blocks)], footer="foot")
    sizes: dict[str, float] = {}

    def note(text: str, _cm: object, tm: list[float], _font: object, size: float) -> None:
        if text.strip():
            sizes[text.strip()] = size * abs(tm[3])

    for page in PdfReader(pdf.write_pdf(document, tmp_path / "x.pdf")).pages:
        page.extract_text(visitor_text=note)
    for word in ("note", "text", "caption", "item", "1", "2"):
        assert any(word in said and size >= LEAST_POINTS for said, size in sizes.items()), (word, sizes)
