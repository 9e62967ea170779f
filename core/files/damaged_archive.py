"""What NumPy archives raise when they were cut or changed."""

from __future__ import annotations

import struct
import tokenize
import zipfile
import zlib

# numpy, zipfile and the header's parser between them.
DAMAGED_ARCHIVE: tuple[type[Exception], ...] = (
    *(OSError, ValueError, EOFError, LookupError, ArithmeticError, MemoryError, RuntimeError, SyntaxError, TypeError),
    *(zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError),
)
