"""The label description file."""

from __future__ import annotations

from pathlib import Path

import pytest

from palpate.core.errors import InputError
from palpate.imaging.contours.itksnap_labels import label_description, label_values, read_label_names
from palpate.imaging.labels import LABELS

LINE = '{value:5d}   255  0    0   1  1  1    "{name}"\n'


def written(tmp_path: Path, *entries: tuple[int, str]) -> Path:
    path = tmp_path / "labels.txt"
    path.write_text("# a comment\n" + "".join(LINE.format(value=v, name=n) for v, n in entries))
    return path


def test_written_and_read_again(tmp_path: Path) -> None:
    (tmp_path / "labels.txt").write_text(label_description())
    assert read_label_names(tmp_path / "labels.txt") == LABELS
    assert label_values(tmp_path / "labels.txt") == {value: value for value in LABELS}


def test_names_decide_whatever_their_numbers(tmp_path: Path) -> None:
    path = written(tmp_path, (0, "Clear Label"), (7, "Prostate left"), (3, "bone"), (9, "Label 9"))
    assert label_values(path) == {0: 0, 7: 1, 3: 4}


def test_a_file_without_our_names_leaves_the_numbers(tmp_path: Path) -> None:
    assert label_values(written(tmp_path, (0, "Clear Label"), (1, "Label 1"))) == {value: value for value in LABELS}


def test_refusals(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="names two labels 'bone'"):
        label_values(written(tmp_path, (3, "bone"), (4, "Bone")))
    with pytest.raises(InputError, match="line 3 describes the value 3 a second time"):
        label_values(written(tmp_path, (3, "bone"), (3, "rectum")))
    (tmp_path / "labels.txt").write_text("1 red prostate\n")
    with pytest.raises(InputError, match=r"labels.txt line 1 is not a label description"):
        label_values(tmp_path / "labels.txt")
