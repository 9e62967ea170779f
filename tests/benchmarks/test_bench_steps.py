"""The bench's part of steps: what a step costs beside one factorisation of its own mesh."""

from __future__ import annotations

from pathlib import Path

import pytest
import synthetic_case
from block_case import write_block_case

from palpate.core.errors import PalpateError
from palpate.ui.cli.commands.bench import _steps
from palpate.validate.bench import steps
from palpate.validate.bench.steps import STEPS, StepCosts, factorisation_cpu_seconds, step_costs


def test_a_factorisation_of_a_case_is_that_of_its_own_mesh(tmp_path: Path) -> None:
    """Linear displacements and pressures at the vertices; what is held has none."""
    posed = synthetic_case.problem((15.0, 45.0), depth=4.5, fine=2)
    unknowns, seconds = factorisation_cpu_seconds(write_block_case(tmp_path / "case", posed, 4.5))
    vertices = len(posed.mesh.points)
    assert 2 * vertices < unknowns < 5 * vertices
    assert 0.0 < seconds < 1.0


def test_a_step_that_fails_is_told_with_its_last_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(steps, "STEPS", ("mesh",))  # of a case that nobody imported
    with pytest.raises(PalpateError, match="the step mesh of the sample pair ended with status 3"):
        step_costs(tmp_path, lambda fraction, message: None)


def test_every_step_has_a_line_and_the_last_adds_up() -> None:
    found: StepCosts = {
        "factorisation_cpu_seconds": 0.5,
        "unknowns": 1234,
        "rows": [
            {"step": "import", "seconds": 3.0, "cpu_seconds": 4.0, "factorisations": 8.0},
            {"step": "mesh", "seconds": 2.0, "cpu_seconds": 1.0, "factorisations": 2.0},
        ],
    }
    first, *rows, last = _steps(found)
    assert "1234 unknowns" in first and "0.500 s" in first
    assert [row.split()[0] for row in rows] == ["import", "mesh"] and rows[0].endswith("8 factorisations")
    assert last.split()[0] == "all" and "5.0 s," in last and last.endswith("10 factorisations")


@pytest.mark.nightly
def test_the_sample_pairs_whole_way_is_measured(tmp_path: Path) -> None:
    found = step_costs(tmp_path, lambda fraction, message: None)
    assert [row["step"] for row in found["rows"]] == list(STEPS)
    assert all(row["cpu_seconds"] > 0.5 and row["factorisations"] > 1.0 for row in found["rows"])
