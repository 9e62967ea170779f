"""The finished case of the sample pair, as it comes with the program: made by `docs/write_sample.py`, unpacked where a person opens it."""

from __future__ import annotations

import shutil
import tempfile
import zipfile
from pathlib import Path

from palpate.case.case_files import file_sha256
from palpate.case.case_folder import STATES, CaseFolder
from palpate.case.sample.scans import sample_folder
from palpate.case.slimmed import ARRAYS, FILE, Slimmed, slim
from palpate.core.errors import InputError
from palpate.core.files import atomic

ARCHIVE = "finished_case.zip"
# Of identify/ and diagnose/ what is shown; the rest is only needed to go on from.
_SHOWN = ("identify/fields.npz", "identify/stiffness_map.npz", "diagnose/gap_maps.npz")
_LEFT_OUT = ("identify/", "diagnose/", "report/", "desktop/", "touch/")
_DATE = (1980, 1, 1, 0, 0, 0)


def finished_archive() -> Path:
    """The archive that comes with the program. Raises InputError where it is absent."""
    archive = sample_folder() / ARCHIVE
    if not archive.is_file():
        raise InputError(f"{archive} is not there; install Palpate again, or clone its repository")
    return archive


def unpack(folder: Path) -> CaseFolder:
    """The finished sample as a case folder, with the CTs of the sample pair; one that is there already is left as it is.

    Raises InputError where the folder cannot be written or the sample is absent or damaged.
    """
    if not (folder / "case.json").is_file():
        archive, scans = finished_archive(), sample_folder()
        try:
            with atomic.atomic_folder(folder) as temporary, zipfile.ZipFile(archive) as packed:
                packed.extractall(temporary)
                for name, source in CaseFolder(temporary).read(FILE, Slimmed).scans.items():
                    (temporary / name).parent.mkdir(exist_ok=True)
                    shutil.copyfile(scans / source, temporary / name)
        except zipfile.BadZipFile as error:
            raise InputError(f"{archive} is damaged; install Palpate again, or clone its repository") from error
    return CaseFolder(folder)


def pack(finished: Path, archive: Path) -> None:
    """Writes the archive of a finished case of the sample pair; the case stays as it is.

    Raises InputError where it is no such case.
    """
    with tempfile.TemporaryDirectory() as folder:
        _slim_copy(CaseFolder(finished), Path(folder))
        with atomic.atomic_path(archive) as path, zipfile.ZipFile(path, "w") as packed:
            for file in sorted(p for p in Path(folder).rglob("*") if p.is_file()):
                entry = zipfile.ZipInfo(file.relative_to(folder).as_posix(), _DATE)
                packed.writestr(entry, file.read_bytes(), zipfile.ZIP_LZMA)


def _slim_copy(case: CaseFolder, folder: Path) -> None:
    for needed in ("result.json", "diagnosis.json", "import.json", *ARRAYS, *_SHOWN):
        if not case.has(needed):
            raise InputError(
                f"{case.file(needed)} is not there; the sample is a case of `palpate demo` that has run to its end"
            )
    names = sorted(p.relative_to(case.path).as_posix() for p in case.path.rglob("*") if p.is_file())
    scans = {n: _source(case, n) for n in names if n.startswith(tuple(f"{state}_ct/" for state in STATES))}
    left_out = [n for n in names if n not in _SHOWN and n.startswith(_LEFT_OUT)]
    for name in sorted({*names} - {*scans} - {*left_out}):
        (folder / name).parent.mkdir(exist_ok=True)
        shutil.copyfile(case.file(name), folder / name)
    copy = CaseFolder(folder)
    copy.write_json("import.json", {**copy.read_json("import.json"), "case": "the sample pair"})
    steps = {name: entry for name, entry in copy.read_json("state.json").items() if name != "report"}
    copy.write_json("state.json", steps)
    files = {name: slim(copy, name) for name in ARRAYS}
    copy.write_json(FILE, Slimmed(files, left_out, scans))


def _source(case: CaseFolder, name: str) -> str:
    """Where the sample pair has a slice of a case."""
    state, number = name.split("_ct/")
    source = f"{state}/CT_{Path(number).stem[1:]}.dcm"
    path = sample_folder() / source
    if not path.is_file() or file_sha256(path) != file_sha256(case.file(name)):
        raise InputError(f"{case.file(name)} is no slice of the sample pair; give a case of `palpate demo`")
    return source
