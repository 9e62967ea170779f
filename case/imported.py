"""What an import has left in a case."""

from __future__ import annotations

from palpate.case.case_folder import CaseFolder


def holds_rest_alone(case: CaseFolder) -> bool:
    """Whether the case holds the scan at rest only, as `plan` takes it; False where the import of a pair was cut short."""
    if case.has("deformed_ct") or case.has_labels("deformed"):
        return False
    return not case.has("import.json") or len(case.read_json("import.json").get("sources_sha256", {})) < 2
