"""Diagnosis of a case whose deformed organ nobody drew: the images alone are data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import synthetic_case

from palpate.core.diagnose.diagnose import diagnose
from palpate.core.diagnose.effects import library
from palpate.core.diagnose.verdict.record import maps, record
from palpate.core.files.json_types import plain
from palpate.core.problem import IdentificationProblem
from palpate.core.residual.case_data import CaseData

EFFECTS = {k: v for k, v in library().items() if k in ("contour_bias", "volume_change", "tissue_stiffening")}
SWOLLEN = 1.15


def _problem() -> IdentificationProblem:
    exact = synthetic_case.problem()
    surface = exact.organ.deformed
    swollen = replace(surface, points=SWOLLEN * surface.points)
    facts = replace(exact.facts, noise_sd_mm=0.3)
    return replace(
        exact,
        facts=facts,
        matched=synthetic_case.matched(),
        organ_drawn=False,
        organ=replace(exact.organ, deformed=swollen),
    )


def test_a_contour_that_nobody_drew_is_no_cause_and_no_yardstick() -> None:
    """The organ's place in the other scan is shown against the model, but neither biased nor predicted better."""
    found = diagnose(CaseData(_problem()), EFFECTS)
    written = plain(record(found, "undrawn"))
    assert {row["effect"] for row in written["ranking"]} == {"volume_change", "tissue_stiffening"}
    off = (SWOLLEN - 1.0) * synthetic_case.RADIUS
    assert 0.5 * off < written["gap"]["rms_mm"] < 1.5 * off
    assert any(row["rms_mm"] > 0.5 * off for row in written["where"]["regions"])
    assert np.isfinite(maps(found)["standardised"]).all() and (maps(found)["standardised"] != 0.0).all()
    if written["shrinkage"] is not None:  # of the motion that the images show: there is no contour to speak of
        assert "surface" not in written["shrinkage"]["parts"]
    assert set(found.split.parts) <= {"inside", "tissue"}
    around = {key: values for key, values in maps(found).items() if key.startswith("motion/")}
    assert {values.shape for values in around.values()} == {(len(synthetic_case.matched().points), 3)}
    assert np.isfinite(around["motion/standardised"]).all() and np.abs(around["motion/residual_mm"]).max() > 0.01
    assert "the images" in written["in_words"]
    assert "contour" not in written["in_words"]
    # Two contours of 0.3 mm and their extraction.
    np.testing.assert_allclose(found.fit.noise_rms_mm, np.hypot(np.sqrt(2.0) * 0.3, found.fit.sizes.per_mode))
