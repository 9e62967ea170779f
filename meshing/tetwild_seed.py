"""A seed for fTetWild, which offers none: pytetwild 0.4.2, the newest, has no such argument, and the C++ behind it seeds its
shuffles from std::random_device (issue 72 of fTetWild: no two meshes are alike).

What `fix_random_device` does: a loaded library calls functions of others through a table of addresses that the loader fills
(ELF's global offset table). The one entry for std::random_device's generator is overwritten, in the memory of this process,
with the address of a counter that starts from the seed. No file is changed, and no other library of the process.

When it does nothing, and says so by returning False: on another system than Linux, for a file that is no 64-bit little-endian
ELF library for x86-64 or aarch64, for a library that is not loaded or never asks std::random_device, and where the table was
made read-only after loading (full RELRO). Meshes then differ from run to run, as those of fTetWild alone do.
"""

from __future__ import annotations

import ctypes
import struct
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

_WANTED = b"_ZNSt13random_device9_M_getvalEv"
_SECTION, _SYMBOL, _RELOCATION = struct.Struct("<IIQQQQIIQQ"), struct.Struct("<IBBHQQ"), struct.Struct("<QQq")
_RELA, _DYNSYM = 4, 11
# Machine -> kinds of table entries that hold a function's address (System V ABI: GLOB_DAT, JUMP_SLOT).
_SLOTS = {62: (6, 7), 183: (1025, 1026)}
_GETVAL = ctypes.CFUNCTYPE(ctypes.c_uint32, ctypes.c_void_p)
_kept: list[object] = []  # a callback must outlive whoever calls it


def fix_random_device(library: Path, seed: int) -> bool:
    """Let the std::random_device of a loaded library give numbers that follow from `seed` alone; see the module for how and when.

    library : file of the loaded library. Returns whether it was done; False means that nothing was changed. Call it before the
    library draws its first number, and in a process of its own: it cannot be undone.
    """
    if not sys.platform.startswith("linux"):
        return False
    slots = list(_slots(library.read_bytes()))
    base = _base(library)
    if base is None or not slots or not all(_writable(base + slot) for slot in slots):
        return False
    callback = _GETVAL(_counter(seed))
    _kept.append(callback)
    address = ctypes.cast(callback, ctypes.c_void_p).value or 0
    for slot in slots:
        ctypes.c_uint64.from_address(base + slot).value = address
    return True


def _counter(seed: int) -> Callable[[int], int]:
    state = seed

    def following(_this: int) -> int:
        """Knuth's linear congruence: each number seeds a Mersenne twister, no more is asked of it."""
        nonlocal state
        state = (state * 6364136223846793005 + 1442695040888963407) % 2**64
        return state >> 32

    return following


def _slots(image: bytes) -> Iterator[int]:
    """Offsets, from where the library is loaded, of its table's entries for random_device; none for a file of another kind."""
    if image[:6] != b"\x7fELF\x02\x01":  # 64 bits, little-endian
        return
    kinds = _SLOTS.get(struct.unpack_from("<H", image, 18)[0], ())
    start, size, count = struct.unpack_from("<Q", image, 40)[0], *struct.unpack_from("<HH", image, 58)
    sections = [_SECTION.unpack_from(image, start + i * size) for i in range(count)]
    for _, kind, _, _, offset, length, link, _, _, _ in sections:
        if kind != _RELA or link >= count or sections[link][1] != _DYNSYM:
            continue
        names = sections[sections[link][6]][4]
        for at in range(offset, offset + length, _RELOCATION.size):
            slot, info, _ = _RELOCATION.unpack_from(image, at)
            if info & 0xFFFFFFFF not in kinds:
                continue
            name = names + _SYMBOL.unpack_from(image, sections[link][4] + (info >> 32) * _SYMBOL.size)[0]
            if image[name : name + len(_WANTED) + 1] == _WANTED + b"\0":
                yield slot


def _base(library: Path) -> int | None:
    """Where the library is loaded."""
    for line in Path("/proc/self/maps").read_text(encoding="utf-8").splitlines():
        parts = line.split(maxsplit=5)
        if len(parts) == 6 and int(parts[2], 16) == 0 and Path(parts[5]) == library.resolve():
            return int(parts[0].split("-")[0], 16)
    return None


def _writable(address: int) -> bool:
    for line in Path("/proc/self/maps").read_text(encoding="utf-8").splitlines():
        span, rights = line.split(maxsplit=2)[:2]
        low, high = (int(x, 16) for x in span.split("-"))
        if low <= address < high:
            return "w" in rights
    return False
