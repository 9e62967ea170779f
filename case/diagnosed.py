"""Result of the diagnose step."""

from __future__ import annotations

from msgspec import UNSET

from palpate.case.case_folder import CaseFolder
from palpate.case.identified import read_result
from palpate.core.diagnose.diagnosis_record import DiagnosisRecord
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.result_record import ResultRecord

DIAGNOSIS = "diagnosis.json"


def read_diagnosis(case: CaseFolder) -> DiagnosisRecord:
    """Content of diagnosis.json. Raises InputError when the file is missing or does not have its form."""
    return case.read(DIAGNOSIS, DiagnosisRecord, "; run `palpate diagnose` again")


def stands_otherwise(case: CaseFolder) -> str:
    """Why the diagnosis in the case does not belong to the stiffness there; "" where it does, or where that is not known.

    Raises InputError for damaged files.
    """
    if not (case.has(DIAGNOSIS) and case.has("result.json")):
        return ""
    return otherwise_words(read_result(case), read_diagnosis(case))


def otherwise_words(result: ResultRecord, diagnosis: DiagnosisRecord) -> str:
    """Which of the two stands on the images and which does not, or on which law of the organ each; "" where both stand on the same, or
    one does not say."""
    options = result.options
    if options is UNSET:
        return ""
    law = diagnosis.law or IdentifyOptions.law
    if law != options.law and diagnosis.image is not UNSET:
        return f"the stiffness stands on the law {options.law}, the diagnosis on {law}"
    if options.image is None or diagnosis.image in (UNSET, options.image):
        return ""
    alone, both = ("diagnosis", "stiffness") if options.image else ("stiffness", "diagnosis")
    return f"the {alone} stands on the contours alone, the {both} on the images too"
