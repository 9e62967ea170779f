"""What a diagnosis of the case has found."""

from __future__ import annotations

from palpate.case.case_folder import CaseFolder
from palpate.core.diagnose.diagnosis_record import DiagnosisRecord

DIAGNOSIS = "diagnosis.json"


def read_diagnosis(case: CaseFolder) -> DiagnosisRecord:
    """diagnosis.json. Raises InputError when it is missing or not in its form."""
    return case.read(DIAGNOSIS, DiagnosisRecord, "; run `palpate diagnose` again")
