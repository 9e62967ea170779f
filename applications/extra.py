"""Libraries that only the applications need, an extra of the installation."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from palpate.core.errors import InputError

EXTRA = "applications"


@contextmanager
def of_the_extra() -> Iterator[None]:
    """Around the import of such a library: raises InputError that names the extra where the library is absent."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise InputError(
            f"{error.name} is not installed; it is of the extra '{EXTRA}': {sys.executable} -m pip install 'palpate[{EXTRA}]'"
        ) from error
