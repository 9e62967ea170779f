"""Result of the diagnose step."""

from __future__ import annotations

from palpate.case.case_folder import CaseFolder
from palpate.core.diagnose.diagnosis_record import DiagnosisRecord

DIAGNOSIS = "diagnosis.json"


def read_diagnosis(case: CaseFolder) -> DiagnosisRecord:
    """Content of diagnosis.json. Raises InputError when the file is missing or does not have its form."""
    return case.read(DIAGNOSIS, DiagnosisRecord, "; run `palpate diagnose` again")
