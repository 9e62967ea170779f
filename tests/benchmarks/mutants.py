"""Does a wrong change to the deciding code fail a test? ``python tests/benchmarks/mutants.py --count 60 --seed 1``.

Mutants of `core/diagnose`, `core/residual` and `core/inference` by mutmut (``pip install mutmut``), drawn at random, each met by the tests
of these rooms that call its function. Declared numbers are not changed. Prints those that live, with what was changed, and counts.
The copy of the program in `--folder` is used again by later runs; the first takes some minutes to note which test calls what.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

TOP = Path(__file__).parents[2]
ROOMS = ("core/diagnose", "core/residual", "core/inference")
PROGRAM = ("core", "imaging", "segmentation", "meshing", "simulate", "case", "validate", "ui", "applications")
DECLARED = ("noise_model_options", "decision_rules", "evidence_rules", "diagnosis_record", "options", "fit_options")
# What mutmut notes of a mutant that no test noticed.
LIVES = {0: "lives", 5: "lives, no test calls it", 33: "lives, no test calls it"}
# Tests that take long, or start processes.
SLOW = "not joint_states and not any_number_of_workers and not test_diagnose and not kept_fit_is_the_one and not fit_to_images"


def copied(folder: Path) -> Path:
    """The program as one package, as mutmut and the import contracts need it; as it is where it was copied before."""
    if folder.exists():
        return folder
    shutil.copytree(TOP / "palpate", folder / "palpate")
    for room in PROGRAM:
        shutil.copytree(TOP / room, folder / "palpate" / room)
    for beside in ("tests", "docs"):
        shutil.copytree(TOP / beside, folder / beside)
    never = [f"*/{name}.py" for name in DECLARED]
    told = {
        "source_paths": [f"palpate/{room}" for room in ROOMS],
        "do_not_mutate": never,
        "also_copy": ["palpate", "tests", "docs"],
        "pytest_add_cli_args_test_selection": [*(f"tests/{room}" for room in ROOMS), "-k", SLOW],
    }
    lines = [f"{key} = {json.dumps(value)}" for key, value in told.items()]
    project = (TOP / "pyproject.toml").read_text(encoding="utf-8")
    (folder / "pyproject.toml").write_text("\n".join([project, "[tool.mutmut]", *lines, ""]), encoding="utf-8")
    return folder


def mutmut(folder: Path, *arguments: str) -> str:
    """What mutmut prints. Raises CalledProcessError."""
    command = [sys.executable, "-m", "mutmut", *arguments]
    return subprocess.run(command, cwd=folder, check=True, stdout=subprocess.PIPE, text=True).stdout


def outcomes(folder: Path) -> dict[str, int | None]:
    """By mutant: what became of it, None where it has not been tried."""
    found: dict[str, int | None] = {}
    for path in sorted((folder / "mutants").rglob("*.meta")):
        found |= json.loads(path.read_text(encoding="utf-8"))["exit_code_by_key"]
    return found


def main() -> None:
    """Draw mutants and print what became of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60, help="mutants, drawn at random (default 60)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--folder", type=Path, default=Path("mutants_study"), help="of the copy (default mutants_study)"
    )
    options = parser.parse_args()
    folder = copied(options.folder.resolve())
    if not (folder / "mutants").exists():
        mutmut(folder, "run", "palpate.core.inference.starts.x_middle__mutmut_1")  # makes them all
    every = sorted(outcomes(folder))
    chosen = random.Random(options.seed).sample(every, options.count)
    mutmut(folder, "run", *chosen)
    became = outcomes(folder)
    for name in chosen:
        if became[name] in LIVES:
            print(f"{LIVES[became[name]]}: {name}\n{mutmut(folder, 'show', name)}")
    print(f"{len(every)} in all; drawn: {dict(Counter(LIVES.get(became[name], 'killed') for name in chosen))}")


if __name__ == "__main__":
    main()
