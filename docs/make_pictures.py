"""Makes every picture of the pages anew: `.venv/bin/python docs/make_pictures.py [--case CASE] [NAME ...]`.

CASE : what `./run demo` leaves, demo_case at the top by default; its report must be up to date. NAME : stiffness, first_page, window,
swarm, touch, drop, python, slicer, sketch; all of them without one. `first_page` needs pdftoppm (poppler-utils), `slicer` the packages of
`./run setup --dev`, `drop` and `sketch` the extra `applications`. The picture of the rooms is drawn by
draw_architecture.py.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.imaging.labels import LABELS

DOCS = Path(__file__).resolve().parent
TOP, TUTORIAL = DOCS.parent, DOCS / "tutorial"
PICTURES = TUTORIAL / "pictures"
# The film of the fall: the organ as found, and one this many times softer; the picture is taken some milliseconds after the start.
SOFTER, FALLEN_MS = 3.0, 92.0
_LATER = ("result.json", "diagnosis.json", "matched_motion.npz", "identify", "diagnose", "report", "touch", "desktop")


def stiffness(case: Path) -> None:
    """The report's slices, on the first page of all."""
    shutil.copyfile(case / "report" / "stiffness_planes.png", DOCS / "stiffness.png")


def first_page(case: Path) -> None:
    """The report's first page."""
    drawn = ["pdftoppm", "-png", "-r", "75", "-f", "1", "-l", "1", "-singlefile", str(case / "report" / "report.pdf")]
    _do([*drawn, str(PICTURES / "report_first_page")])


def window(case: Path) -> None:
    """The window, from its first page to the stiffness and the map."""
    _play("window_pictures.txt", case)


def swarm(case: Path) -> None:
    """The window while it searches: on a case whose stiffness has not been found."""
    with _scratch() as scratch:
        begun = _copy(case, scratch / "demo_case", _LATER)
        state = json.loads((begun / "state.json").read_text())
        kept = {name: entry for name, entry in state.items() if name in ("import", "segment", "mesh")}
        (begun / "state.json").write_text(json.dumps(kept))
        _play("window_swarm.txt", begun)


def touch(case: Path) -> None:
    """The probe in the stiffer half, from the front."""
    G = json.loads((case / "result.json").read_text())["parameters"]
    labels, stiffer = CaseFolder(case).labels("rest"), max(G, key=lambda name: G[name]["G_kpa"])
    (value,) = (number for number, name in LABELS.items() if name == stiffer)
    x, y, z = labels.to_lps(np.argwhere(labels.array == value).mean(axis=0)) - np.array([0.0, 60.0, 5.0])
    lines = [
        *("resize 1180 760", "turn 12 8", f"touch {x:.1f} {y:.1f} {z:.1f}", "press 4", "pause 2"),
        *(f"screenshot {DOCS / 'touch.png'}", "quit"),
    ]
    with _scratch() as scratch:
        script = scratch / "touch.txt"
        script.write_text("\n".join(lines))
        _palpate("touch", str(case), "--headless", "--script", str(script), "-o", str(scratch))


def drop(case: Path) -> None:
    """The organ in its dish beside a softer one of the same form."""
    import cv2

    with _scratch() as scratch:
        softer = _copy(case, scratch / "softer", ("rest_ct", "deformed_ct", "report"))
        result = json.loads((softer / "result.json").read_text())
        for entry in result["parameters"].values():
            entry.update({k: entry[k] / SOFTER for k in ("G_kpa", "mu1_kpa", "mu2_kpa", "mu_mean_kpa") if entry.get(k)})
        (softer / "result.json").write_text(json.dumps(result))
        film = scratch / "film.mp4"
        _palpate("drop", str(softer), str(case), "-o", str(film), "--time", "0.12")
        seen = cv2.VideoCapture(str(film))
        wanted = int(FALLEN_MS * 1e-3 / 0.12 * seen.get(cv2.CAP_PROP_FRAME_COUNT))
        seen.set(cv2.CAP_PROP_POS_FRAMES, wanted)
        cv2.imwrite(str(DOCS / "drop.png"), seen.read()[1])


def python(case: Path) -> None:
    """What the code of the Python tutorial draws; it is run as the page has it."""
    blocks = re.findall(r"```python\n(.*?)```", (TUTORIAL / "python.md").read_text(encoding="utf-8"), re.DOTALL)
    code = "import matplotlib\nmatplotlib.use('Agg')\n" + "\n".join(b for b in blocks if not b.startswith("# not run"))
    with _scratch() as scratch:
        (scratch / "demo_case").symlink_to(case)
        (scratch / "tutorial.py").write_text(code)
        _do([sys.executable, "tutorial.py"], cwd=scratch)
        for name in ("sphere", "ball", "case", "labels"):
            shutil.copyfile(scratch / f"{name}.png", PICTURES / f"python_{name}.png")


def slicer(case: Path) -> None:
    """The module's screenshot and the steps of its tutorial."""
    drawn_by = DOCS / "slicer_pictures"
    _do([sys.executable, str(drawn_by / "make.py"), str(case)])
    _do([sys.executable, str(drawn_by / "make_steps.py"), str(case), str(PICTURES)])


def sketch(case: Path) -> None:
    """The keyframes drawn by hand, and the figure at each."""
    keys = [str(DOCS / "sketch" / f"hand_{number}.png") for number in (1, 2, 3)]
    with _scratch() as scratch:
        _palpate("sketch", *keys, "-o", str(scratch / "cactus"))
        shutil.copyfile(scratch / "cactus" / "keyframes.png", DOCS / "sketch" / "hand_keyframes.png")


MAKERS: dict[str, Callable[[Path], None]] = {
    maker.__name__: maker for maker in (stiffness, first_page, window, swarm, touch, drop, python, slicer, sketch)
}


def main() -> None:
    """Draws what is asked for, and names it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--case", type=Path, default=TOP / "demo_case")
    parser.add_argument("names", nargs="*", choices=[[], *MAKERS], metavar="NAME")
    given = parser.parse_args()
    if not (given.case / "report" / "report.pdf").is_file():
        parser.error(f"{given.case} has no report; run ./run demo first, or give a case that it has finished")
    for name in given.names or MAKERS:
        print(name, flush=True)
        MAKERS[name](given.case.resolve())


def _play(name: str, case: Path) -> None:
    """A script of the tutorial on another case, into the same pictures."""
    text = (TUTORIAL / name).read_text(encoding="utf-8").replace("../../demo_case", str(case))
    with _scratch() as scratch:
        script = scratch / name
        script.write_text(re.sub(r"^screenshot ", f"screenshot {TUTORIAL}/", text, flags=re.MULTILINE))
        _palpate("open", "--headless", "--script", str(script))


def _copy(case: Path, to: Path, without: tuple[str, ...]) -> Path:
    return shutil.copytree(case, to, ignore=lambda folder, _: without if Path(folder) == case else ())


def _palpate(*words: str) -> None:
    _do([sys.executable, "-m", "palpate.ui.cli", *words])


def _do(command: list[str], cwd: Path = TOP) -> None:
    """Ends this program where the command fails."""
    done = subprocess.run(command, cwd=cwd, check=False)
    if done.returncode:
        sys.exit(f"make_pictures: {' '.join(command)} ended with {done.returncode}")


@contextmanager
def _scratch() -> Iterator[Path]:
    """A folder for one picture, and settings of its own: no earlier case of this person stands on a picture."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["PALPATE_SETTINGS"] = str(Path(folder) / "settings")
        yield Path(folder)


if __name__ == "__main__":
    main()
