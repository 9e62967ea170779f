"""What a table of many patients takes of one report: how sure, where the contours are from, and warnings."""

from __future__ import annotations

from typing import TypedDict

from palpate.case.case_folder import CaseFolder
from palpate.ui.report.record import CaseRecord, read_record
from palpate.ui.report.regions import in_words
from palpate.ui.report.summary import what_lacks
from palpate.ui.report.trust import how_sure, missing
from palpate.ui.words.label_words import WORDS


class Conclusions(TypedDict):
    """how_sure : by region. contours : by state, how the prostate's contour came about. warnings : one line each."""

    how_sure: dict[str, str]
    contours: dict[str, str]
    warnings: list[str]


def conclusions(case: CaseFolder) -> Conclusions:
    """Conclusions of a case that has been identified, in the words of its report.

    Raises InputError as `read_record` does.
    """
    record = read_record(case, {})
    lines = dict.fromkeys([*what_lacks(record), *missing(record)])
    return {
        "how_sure": {region.name: how_sure(region, record) for region in record.regions},
        "contours": contour_origins(record),
        "warnings": [in_words(line, record.result.parameters) for line in lines],
    }


def contour_origins(record: CaseRecord) -> dict[str, str]:
    """How the prostate's contour came about in each segmented state, in words; "given with the case" where labels came with it."""
    found = {}
    for state, facts in record.segmentation.get("states", {}).items():
        organ = facts.get("organs", {}).get("prostate")
        found[state] = "given with the case" if organ is None else WORDS.get(organ["method"], organ["method"])
    return found
