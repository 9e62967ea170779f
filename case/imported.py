"""State of a case after import."""

from __future__ import annotations

from palpate.case.case_folder import CaseFolder


def holds_rest_alone(case: CaseFolder) -> bool:
    """Whether the case has a scan at rest and no deformed one, as `plan` takes it.

    False for a pair whose import was interrupted. Raises InputError when import.json is damaged.
    """
    if case.has("deformed_ct") or case.has_labels("deformed"):
        return False
    return not case.has("import.json") or len(case.read_json("import.json").get("sources_sha256", {})) < 2
