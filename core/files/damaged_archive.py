"""Exceptions that damaged NumPy archives raise."""

from __future__ import annotations

import struct
import tokenize
import zipfile
import zlib

# Those of numpy, zipfile and the header's parser together.
DAMAGED_ARCHIVE: tuple[type[Exception], ...] = (
    *(OSError, ValueError, EOFError, LookupError, ArithmeticError, MemoryError, RuntimeError, SyntaxError, TypeError),
    *(zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError),
)
