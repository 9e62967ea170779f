"""How a report's PDF fills its pages, and that console and report give the same figures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from phantoms import recorded, result
from PIL import Image
from pypdf import PdfReader
from reportlab.pdfbase.pdfmetrics import stringWidth

from palpate.case.case_folder import CaseFacts
from palpate.ui.cli.commands import import_scans, segment
from palpate.ui.pictures.lettering import SMALLEST
from palpate.ui.pictures.slices import as_pdf
from palpate.ui.report import document as doc
from palpate.ui.report import pdf
from palpate.ui.report.pdf_parts import column_widths
from palpate.ui.report.quality import quality
from palpate.ui.report.record import CaseRecord
from palpate.ui.report.summary import misfit_verdict
from palpate.ui.report.trust import missing

WHOLE_PAGE = 730.0  # points between the margins, about


def picture(folder: Path, height: int) -> doc.Picture:
    """1000 pixels wide: drawn as wide as the page."""
    path = folder / f"{height}.png"
    Image.new("RGB", (1000, height), "grey").save(path)
    return doc.Picture(path, "A caption.", "Nothing.")


@pytest.mark.parametrize("share, fits", [(1.1, True), (0.85, True), (0.5, False)])
def test_a_picture_shrinks_a_little_rather_than_leave_a_page_empty(tmp_path: Path, share: float, fits: bool) -> None:
    pdf._register_fonts()
    flowable = pdf._flowable(picture(tmp_path, 600))
    whole = flowable.wrap(pdf._WIDTH, WHOLE_PAGE)[1]
    left = share * whole
    assert (flowable.wrap(pdf._WIDTH, left)[1] <= left) == fits
    assert flowable.wrap(pdf._WIDTH, WHOLE_PAGE)[1] == whole, "whole again where there is room"


def test_two_pictures_that_nearly_fit_share_a_page(tmp_path: Path) -> None:
    pictures = [picture(tmp_path, height) for height in (620, 621)]
    path = pdf.write_pdf(doc.Document("Title", "case", [doc.Section("Fit", pictures)]), tmp_path / "x.pdf")
    assert len(PdfReader(path).pages) == 1


def test_figures_are_vectors_in_the_pdf(tmp_path: Path) -> None:
    figure = Figure(figsize=(4.0, 2.0))
    figure.subplots().set_title("a title of letters")
    drawn = replace(picture(tmp_path, 500), vector=as_pdf(figure))
    page = PdfReader(pdf.write_pdf(doc.Document("T", "c", [doc.Section("Fit", [drawn])]), tmp_path / "x.pdf")).pages[0]
    assert "a title of letters" in page.extract_text() and not page.images
    pixels = doc.Document("T", "c", [doc.Section("Fit", [picture(tmp_path, 500)])])
    assert PdfReader(pdf.write_pdf(pixels, tmp_path / "y.pdf")).pages[0].images


def test_pictures_stand_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    """1,300 high needs a page of its own; 500 would fit what 700 has left of the first, but follows it."""
    pdf._register_fonts()
    tall, low, small = (picture(tmp_path, height) for height in (700, 1300, 500))
    (run,) = pdf._runs([pdf._flowable(p) for p in (tall, low, small)])
    first, rest = run.split(pdf._WIDTH, WHOLE_PAGE)
    assert first._path == str(tall.path)
    second, last = rest.split(pdf._WIDTH, WHOLE_PAGE)
    assert second._path == str(low.path)
    assert [p._path for p in last.split(pdf._WIDTH, WHOLE_PAGE)] == [str(small.path)]
    assert run.split(pdf._WIDTH, 100.0) == [], "nothing fits: the next page"


def test_pictures_that_share_a_page_are_made_smaller_alike(tmp_path: Path) -> None:
    pdf._register_fonts()
    (run,) = pdf._runs([pdf._flowable(picture(tmp_path, height)) for height in (800, 700)])
    both = run.split(pdf._WIDTH, WHOLE_PAGE)
    for p in both:
        p.wrap(pdf._WIDTH, WHOLE_PAGE)
    assert len(both) == 2 and both[0]._scale == both[1]._scale and SMALLEST <= both[0]._scale < 1.0


@pytest.mark.parametrize("high, page", [(700, 0), (1000, 1)])
def test_a_long_table_goes_on_over_the_page_but_not_from_its_heading(tmp_path: Path, high: int, page: int) -> None:
    """Below a picture of 125 mm there is room for the heading and half of the rows, below one of 175 mm for a few."""
    table = doc.Table(("", ""), [(f"row {i}.", "x") for i in range(30)], numbers=False)
    sections = [doc.Section("First", [picture(tmp_path, high)]), doc.Section("Long", [table])]
    path = pdf.write_pdf(doc.Document("Title", "case", sections), tmp_path / "x.pdf")
    pages = [page.extract_text() for page in PdfReader(path).pages]
    assert len(pages) == 2 and "Long" in pages[page] and "row 0." in pages[page] and "row 29." in pages[1]


def test_a_heading_goes_over_the_page_with_its_table(tmp_path: Path) -> None:
    """A sentence between them does not part them."""
    table = doc.Table(("what", ""), [(f"row {i}.", "x") for i in range(6)])
    motion = doc.Section("Motion", [doc.Paragraph("It comes from both."), table])
    document = doc.Document("Title", "case", [doc.Section("First", [picture(tmp_path, 1190)]), motion])
    pages = [page.extract_text() for page in PdfReader(pdf.write_pdf(document, tmp_path / "x.pdf")).pages]
    assert len(pages) == 2 and "Motion" not in pages[0] and "Motion" in pages[1] and "row 0." in pages[1]


def test_figures_are_aligned_right_and_words_left() -> None:
    rows = [("left half", "37.3", "found automatically", "\N{EN DASH}"), ("bone", "147.6", "0 times", "")]
    assert doc.Table(("a", "b", "c", "d"), rows).right == (False, True, False, True)
    assert doc.Table(("a", "b"), [("x", "1")], numbers=False).right == (False, False)


def test_no_word_of_a_header_is_broken_and_captions_are_there(tmp_path: Path) -> None:
    pdf._register_fonts()
    table = doc.Table(
        ("effect", "probability", "gain", "parameters"), [("prestress", "0.1", "0", "x" * 80)], "What it is"
    )
    widths = column_widths(table, pdf._WIDTH, "DejaVuSans-Bold", 8.5)
    assert sum(widths) == pytest.approx(pdf._WIDTH)
    assert all(
        width > stringWidth(word, "DejaVuSans-Bold", 8.5) + 12.0  # the cell's own margins
        for width, word in zip(widths, table.header, strict=True)
    )
    path = pdf.write_pdf(doc.Document("Title", "case", [doc.Section("Fit", [table])]), tmp_path / "x.pdf")
    assert "What it is" in PdfReader(path).pages[0].extract_text()


def test_alignment_is_one_figure_on_the_console_and_in_the_report() -> None:
    """0.0454 mm is 0.045 in import.json and would be 0.05 in the report, 0.04 on the console."""
    imported = {"case": "c", "residual_mm": 0.045, "notes": [], "sources_sha256": {"rest": "a", "deformed": "b"}}
    record = CaseRecord(CaseFacts("c"), recorded(), {"residual_mm": 0.0454}, {}, {}, imported)
    (told,) = [b.text for b in quality(record, []).blocks if isinstance(b, doc.Paragraph)]
    assert "0.04 mm rms" in told and "0.04 mm rms" in import_scans.text_of(imported)[0]


STATE = {
    "organs": {
        "prostate": {"method": "carried", "confidence": 0.63, "volume_cc": 69.15},
        "bladder": {"method": "user", "confidence": 1.0, "volume_cc": 311.9},
    },
    "volume_in_region_cc": {"prostate_left": 32.72, "prostate_right": 35.77, "bladder": 308.99, "bone": 12.0},
}


def test_console_gives_the_volumes_of_the_written_labels() -> None:
    (line,) = segment.text_of({"states": {"deformed": STATE}, "notes": []})
    assert "prostate 68.5 cc (found near its place at rest, confidence 0.63)" in line
    assert "bladder 309.0 cc (drawn by hand)" in line


def test_the_report_says_what_an_organ_found_near_its_place_is() -> None:
    volumes = {"deformed": {"prostate_left": 32.72, "bladder": 308.99}}
    segmentation = {"states": {"deformed": STATE}}
    record = CaseRecord(CaseFacts("c"), recorded(), {}, segmentation, {}, {}, volumes_cc=volumes)
    blocks = quality(record, []).blocks
    assert isinstance(blocks[0], doc.Table)
    assert blocks[0].rows[0][-1] == "found near its place at rest, confidence 0.63"
    assert any("outline are not carried over" in b.text for b in blocks if isinstance(b, doc.Paragraph))
    by_hand = {**STATE, "organs": {"prostate": {"method": "user", "confidence": 1.0, "volume_cc": 1.0}}}
    drawn = CaseRecord(CaseFacts("c"), recorded(), {}, {"states": {"deformed": by_hand}}, {}, {}, volumes_cc=volumes)
    assert not any("carried over" in b.text for b in quality(drawn, []).blocks if isinstance(b, doc.Paragraph))


def test_a_contour_that_was_carried_over_is_not_said_to_repeat() -> None:
    """Its error is in both scans alike: what one contour repeats to says nothing of their difference."""
    carried = {**STATE, "organs": {"prostate": {"method": "propagated", "confidence": 0.9, "volume_cc": 69.15}}}
    states = {"states": {"deformed": STATE}}
    estimated = result()
    estimated["misfit"] |= {"contour_noise_from": "image", "contour_noise_sd_mm": 0.4, "expected_noise_rms_mm": 9.0}
    found = CaseRecord(CaseFacts("c"), recorded(estimated), {}, states, {}, {})
    over = replace(found, segmentation={"states": {"rest": STATE, "deformed": carried}})
    assert over.carried_over and not found.carried_over
    assert found.noise_sd_mm is not None and "if contours repeat to" in misfit_verdict(found)
    assert over.noise_sd_mm is None and "repeat" not in misfit_verdict(over)
    shared = "have in common: assumed"
    assert any(shared in line for line in missing(found))
    assert not any(shared in line for line in missing(over))
