"""What `palpate mesh` takes from its command line."""

from __future__ import annotations

import pytest

from palpate.meshing.mesh_options import MeshOptions
from palpate.ui.cli import main as cli
from palpate.ui.cli.commands import mesh


def asked(*words: str) -> MeshOptions:
    given = ["mesh", "CASE", *words]
    return mesh.options_of(cli.parser(given).parse_args(given))


def test_the_first_seed_is_that_of_the_usual_mesh() -> None:
    assert asked() == asked("--seed", "1") == MeshOptions()


@pytest.mark.parametrize("seed", [2, 81])
def test_another_seed_is_another_mesh(seed: int) -> None:
    assert asked("--seed", str(seed)).seed != MeshOptions().seed
    assert asked("--seed", str(seed)) != asked("--seed", str(seed + 1))


def test_tetrahedra_are_as_many_as_asked_for() -> None:
    assert asked("--tets", "900").target_tets == 900
