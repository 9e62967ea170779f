"""Makes the finished sample, `sample_dicom/finished_case.zip`, anew: `.venv/bin/python docs/write_sample.py [CASE]`.

CASE : a case that `./run demo` has finished with this program. Without one the sample pair is run first, which takes some minutes. Run it
whenever the numbers of the demo have changed; `tests/case/test_finished_sample.py` says when the sample no longer holds.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from palpate.case.sample.finished import ARCHIVE, pack
from palpate.case.sample.scans import sample_folder
from palpate.core.errors import InputError


def main(arguments: list[str]) -> int:
    """Exit status."""
    with tempfile.TemporaryDirectory() as scratch:
        case = Path(arguments[0]) if arguments else Path(scratch) / "demo_case"
        if not arguments:
            status = subprocess.run(
                [sys.executable, "-m", "palpate.ui.cli", "demo", "-o", str(case)], check=False
            ).returncode
            if status:
                return status
        archive = sample_folder() / ARCHIVE
        try:
            pack(case, archive)
        except InputError as error:
            print(f"write_sample: {error}", file=sys.stderr)
            return 3
    print(f"{archive}: {archive.stat().st_size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
