"""What a study says while it runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from palpate.validate.sealed import SealedStudy, make_each, time_left


@pytest.mark.parametrize(
    ("seconds", "done", "count", "words"),
    [(60.0, 1, 11, ", about 10 min left"), (61.0, 2, 3, ", about 1 min left"), (90.0, 5, 5, "")],
)
def test_the_time_left_follows_from_what_is_done(seconds: float, done: int, count: int, words: str) -> None:
    assert time_left(seconds, done, count) == words


def test_a_study_tells_how_far_it_is_and_goes_on_with_what_has_no_result(tmp_path: Path) -> None:
    study, said = SealedStudy(tmp_path, "done.json"), list[tuple[float, str]]()
    study.begin({"study": "any"}, {"study": "any"}, str)
    study.answers.mkdir()
    for name in "abc":
        (study.cases / name).mkdir()
        (study.answers / f"{name}.json").write_text("{}")
    (study.cases / "a" / "done.json").write_text("{}")
    study.seal("abc")
    seen: list[str] = []

    def analyse(case: Path) -> None:
        seen.append(case.name)
        (case / "done.json").write_text("{}")

    study.analyse("abc", analyse, 1, lambda share, words: said.append((share, words)))
    assert seen == ["b", "c"]
    assert [share for share, _ in said] == [0.5, 1.0]
    assert said[0][1].startswith("analysed 1 of 2, about ")
    assert said[1][1] == "analysed 2 of 2"
    study.check_unchanged()


def test_items_are_made_one_after_another_and_told() -> None:
    said: list[str] = []
    made: list[int] = []
    make_each(made.append, [3, 1, 2], 1, lambda share, words: said.append(f"{share:.2f} {words}"))
    assert made == [3, 1, 2]
    assert said[0].startswith("0.33 made 1 of 3, about ")
    assert said[-1] == "1.00 made 3 of 3"
