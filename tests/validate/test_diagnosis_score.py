"""Scores of the posterior over causes, from what pairs of scans hide and what was said of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pytest

from palpate.validate.images.diagnosis_score import diagnosis_score, score_text
from palpate.validate.images.said import Said


def _said(
    hidden: str, verdict: str, posterior: Mapping[str, float], candidates: Sequence[str] = (), left_near_mm: float = 0.5
) -> Said:
    return Said(
        "pair",
        "images",
        {},
        {},
        verdict,
        0.5,
        tuple(candidates),
        hidden,
        0.1,
        (),
        left_near_mm if hidden else None,
        posterior,
    )


SURE = {"none": 0.0, "inclusion": 0.9, "prestress": 0.1, "unknown": 0.0}
NOTHING = {"none": 1.0, "inclusion": 0.0, "unknown": 0.0}


def test_every_kind_of_pair_counts_for_what_it_is() -> None:
    pairs = [
        _said("inclusion", "inclusion", SURE, ["inclusion"]),
        _said("inclusion", "ambiguous", SURE, ["prestress", "volume_change", "inclusion"]),
        _said("inclusion", "ambiguous", SURE, ["prestress", "volume_change", "bone_motion", "inclusion"]),
        _said("inclusion", "none", NOTHING),
        _said("inclusion", "none", NOTHING, left_near_mm=0.29),  # shows too little to be asked for
        _said("", "none", NOTHING),
        _said("", "prestress", SURE, ["prestress"]),
        _said("capsule", "unknown", {"unknown": 0.4, "none": 0.6}),
        _said("capsule", "ambiguous", SURE),
        _said("capsule", "inclusion", {"unknown": 0.51, "inclusion": 0.49}, ["inclusion"]),
        _said("capsule", "none", {"unknown": 0.5, "none": 0.5}),
        _said("capsule", "none", NOTHING, left_near_mm=0.1),
    ]
    score = diagnosis_score(pairs)
    assert score is not None
    assert (score["visible"], score["in_set"], score["alone"]) == (4, 2, 1)
    assert (score["nothing"], score["alarms"]) == (2, 1)
    assert (score["outside"], score["refused"]) == (4, 3)


def test_probabilities_are_scored_against_the_truth() -> None:
    """By hand: (1 - 0.9)^2 + 0.1^2 of the first pair, 0 of the second, 1 + 1 of a capsule that was sure to be nothing."""
    pairs = [_said("inclusion", "inclusion", SURE), _said("", "none", NOTHING), _said("capsule", "none", {"none": 1.0})]
    score = diagnosis_score(pairs)
    assert score is not None
    assert score["brier"] == pytest.approx((0.02 + 0.0 + 2.0) / 3.0, abs=1e-3)
    low, middle, high = score["reliability"]
    # Of nine hypotheses five were held impossible, and one of these was so: the capsule's, which the posterior did not name.
    assert (low["count"], low["stated"], low["true"]) == (5, 0.0, 0.2)
    assert (middle["count"], middle["stated"], middle["true"]) == (1, 0.1, 0.0)
    assert (high["count"], high["stated"], high["true"]) == (3, 0.967, 0.667)
    lines = score_text(score)
    assert "alone 1; alarms 0 of 1; without a name refused 0 of 1; Brier score 0.67" in lines[0]
    assert lines[-1] == "  stated 0.97, true 0.67 (3 hypotheses)"


def test_no_diagnosis_is_no_score() -> None:
    assert diagnosis_score([_said("", "", {})]) is None
