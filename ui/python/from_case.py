"""A case folder at a prompt: its scans, labels and what was found."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from palpate.case.case_folder import STATES, CaseFolder
from palpate.case.diagnosed import DIAGNOSIS, read_diagnosis
from palpate.case.identified import read_result
from palpate.imaging.volume import Volume
from palpate.ui.python.checks import path_of
from palpate.ui.python.findings import Gap, Stiffness


@dataclass(frozen=True, eq=False, repr=False)
class Case:
    """folder : the case. Everything is read when it is asked for."""

    folder: CaseFolder

    @property
    def stiffness(self) -> Stiffness | None:
        """What `palpate identify` found; None before. Raises InputError for a damaged file."""
        return Stiffness(read_result(self.folder)) if self.folder.has("result.json") else None

    @property
    def diagnosis(self) -> Gap | None:
        """What `palpate diagnose` says; None before. Raises InputError for a damaged file."""
        return Gap(read_diagnosis(self.folder)) if self.folder.has(DIAGNOSIS) else None

    def labels(self, state: str = "rest") -> Volume:
        """Labels of a scan ("rest" or "deformed"), in the frame of the scan at rest. Raises InputError where there are none."""
        return self.folder.labels(state)

    def ct(self, state: str = "rest") -> Volume:
        """A scan, HU, in the frame of the scan at rest. Raises InputError where there is none."""
        return self.folder.ct(state)

    def __repr__(self) -> str:
        have = [f"{state} {what}" for state in STATES for what, there in self._parts(state) if there]
        lines = [f"case {self.folder.path.name}: {', '.join(have) or 'empty'}"]
        lines += [repr(found) for found in (self.stiffness, self.diagnosis) if found is not None]
        return "\n".join(lines)

    def _parts(self, state: str) -> tuple[tuple[str, bool], ...]:
        return ("CT", self.folder.has(f"{state}_ct")), ("labels", self.folder.has_labels(state))


def load(case: str | Path) -> Case:
    """A case folder. Raises InputError where it is none."""
    return Case(CaseFolder(path_of(case, "case")))
