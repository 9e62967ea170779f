"""JSON files: read with one clear line where they are damaged, written whole or not at all."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TypeVar

import msgspec
import numpy as np

from palpate.core.errors import InputError
from palpate.core.files.atomic import atomic_path
from palpate.core.files.json_types import plain, typed

T = TypeVar("T")


def read_json(path: Path) -> object:
    """The content of a JSON file. Raises InputError naming the file, the line when it is not JSON, or a key that is given twice."""
    try:
        parsed: object = json.loads(
            path.read_text(encoding="utf-8-sig"), object_pairs_hook=lambda pairs: _once(pairs, path)
        )
    except FileNotFoundError as error:
        raise InputError(f"{path} is not there; run the step that writes it first") from error
    except json.JSONDecodeError as error:
        raise InputError(f"{path} is not valid JSON at line {error.lineno}; correct it") from error
    except (ValueError, RecursionError) as error:  # no UTF-8, a number of thousands of digits, thousands of brackets
        raise InputError(f"{path} is not valid JSON; correct it") from error
    return parsed


def _once(pairs: list[tuple[str, object]], path: Path) -> dict[str, object]:
    """An object of a file. Raises InputError for a key that it holds twice, of which JSON takes the last."""
    found = dict(pairs)
    if len(found) < len(pairs):
        twice = next(key for key in found if [name for name, _ in pairs].count(key) > 1)
        raise InputError(f"{path}: {twice} is given twice in one object; keep one of them")
    return found


def read_typed(path: Path, kind: type[T], remedy: str = "; correct it there") -> T:
    """The content of a JSON file as a declared type (`json_types.typed`). Raises InputError, also naming what is wrong
    in it.
    """
    return typed(read_json(path), kind, str(path), remedy)


def write_json(path: Path, data: object) -> Path:
    """Writes a JSON file (`as_json`) atomically. Raises InputError naming the file where it cannot be written."""
    text = as_json(data)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def as_json(data: object) -> str:
    """JSON text of plain data or of an instance of a declared type; NumPy arrays become lists. Raises ValueError for
    NaN and infinity.
    """
    return json.dumps(data, indent=2, allow_nan=False, default=_plain, ensure_ascii=False) + "\n"


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, msgspec.Struct):
        return plain(value)
    if isinstance(value, Path):
        return value.as_posix()
    raise TypeError(f"{type(value).__name__} is not JSON")
