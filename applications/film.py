"""Films: pictures one after the other in an mp4 that browsers and ordinary players show."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.applications.extra import of_the_extra
from palpate.core.arrays import LabelArray
from palpate.core.errors import InputError

if TYPE_CHECKING:
    import cv2

# VP9 where this build of FFmpeg has it, else MPEG-4 part 2, which every build has and fewer browsers show.
_CODECS = ("vp09", "mp4v")


def write_film(path: Path, pictures: Iterable[LabelArray], per_second: float) -> str:
    """Write pictures (height, width, 3) RGB, all of one even size, to `path`, whose name ends in .mp4; returns the codec's name.

    Write to a path of `atomic_path`: a film that was cut off in the middle is no film. Raises InputError where no picture is
    given, none of the codecs works or the file cannot be written.
    """
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # it tells of codecs tried in vain on standard error

    writer, codec, size = None, "", (0, 0)
    try:
        for picture in pictures:
            if writer is None:
                size = (picture.shape[1], picture.shape[0])
                writer, codec = _open(path, per_second, size)
            if (picture.shape[1], picture.shape[0]) != size:
                raise ValueError(f"a picture of {picture.shape} in a film of {size}")
            writer.write(np.ascontiguousarray(picture[..., ::-1]))
    finally:
        if writer is not None:
            writer.release()
    if writer is None:
        raise InputError(f"{path}: a film needs at least one picture")
    if not path.is_file() or path.stat().st_size == 0:
        raise InputError(f"{path} cannot be written; check disk space and permissions")
    return codec


def _open(path: Path, per_second: float, size: tuple[int, int]) -> tuple[cv2.VideoWriter, str]:
    with of_the_extra():
        import cv2

    if size[0] % 2 or size[1] % 2:
        raise ValueError(f"a film's pictures need an even width and height, not {size}")
    for codec in _CODECS:
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), per_second, size)
        if writer.isOpened():
            return writer, codec
        writer.release()
    raise InputError(f"{path}: this machine's FFmpeg writes none of {', '.join(_CODECS)}; see `palpate doctor`")
