"""The paper's tables in short, on coarse meshes. The full ones: `palpate validate table1`, `table2`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from palpate.ui.cli.commands.validate import STUDIES
from palpate.validate.paper.tumour_data import tumour_data
from palpate.validate.paper.tumour_scene import LEFT, TUMOUR, Divisions, halved_ball, organ_volume, with_tumour
from palpate.validate.paper.tumour_tables import TableOptions, table1


@pytest.fixture(scope="module")
def study() -> dict[str, Any]:
    return table1(TableOptions.quick())


@pytest.mark.nightly
def test_what_is_found_rises_with_the_tumour_and_is_near_what_the_half_has(study: dict[str, Any]) -> None:
    assert study["rises"] and study["correlation"]["clean"] > 0.9
    for row in study["rows"]:
        # Coarse meshes; the full study's figures are in docs/measured.md.
        assert np.abs(row["error_percent"]).max() < 12.0
        low, high = row["noisy"]["ci95_kpa"].T
        assert (low < row["effective_mu_kpa"]).all() and (high > row["effective_mu_kpa"]).all()


@pytest.mark.nightly
def test_the_study_tells_and_draws_the_papers_values_beside(study: dict[str, Any]) -> None:
    told = STUDIES["table1"].text(study)
    assert "0.9659" in told and len(told.splitlines()) == len(study["rows"]) + 7
    picture = STUDIES["table1"].picture
    assert picture is not None
    assert any("paper" in t.get_text() for t in picture(study).legends[0].get_texts())


def test_a_half_with_a_tumour_is_between_its_parts_and_a_uniform_one_is_itself() -> None:
    small = Divisions(2, 1, 1)
    data = tumour_data(0.5, 70.0, small, energies=True)
    assert 30.0 < data.effective_mu[0] < 70.0 and data.effective_mu[1] == 30.0
    # Hashin-Shtrikman's lower bound of an incompressible mixture: soft outside, hard inside.
    c = data.share
    bound = 30.0 + c / (1.0 / 40.0 + 2.0 * (1.0 - c) / (5.0 * 30.0))
    assert data.effective_mu[0] > 0.97 * bound
    # What surface motion alone would store is least, because a soft rim follows it.
    assert 30.0 < data.left.energy_of_its_surface < data.left.energy_in_place < 1.05 * data.effective_mu[0] < 70.0
    same = tumour_data(0.5, 30.0, small, energies=True)
    assert same.effective_mu[0] == pytest.approx(30.0, rel=1e-9)
    assert (same.left.energy_in_place, same.left.energy_of_its_surface) == pytest.approx((30.0, 30.0), rel=1e-4)


def test_a_tumour_has_its_share_and_lies_within_its_half() -> None:
    mesh = with_tumour(halved_ball(Divisions(4, 2, 1)), 0.3)
    inside = mesh.regions == TUMOUR
    half = mesh.volumes[np.isin(mesh.regions, (LEFT, TUMOUR))].sum()
    assert mesh.volumes[inside].sum() / half == pytest.approx(0.3, abs=0.02)
    assert mesh.points[mesh.cells[inside]].mean(axis=1)[:, 0].min() > 0.0
    fine = organ_volume(halved_ball(Divisions(4, 2, 2)))
    assert organ_volume(halved_ball(Divisions(2, 1, 2), fine)) == pytest.approx(fine)
