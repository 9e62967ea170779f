"""Where the peers live: an environment of their own, made on demand; programs that are installed or not."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

from palpate.validate.bench.contender import PEERS, ContenderSpec

# Never in the project's own lock: FElupe is GPL, and it runs as a program of its own.
REQUIREMENTS = ("felupe==11.3.0", "scikit-fem==12.0.2", "pypardiso==0.4.7", "numpy>=2,<2.5", "scipy>=1.14")
# Peers that there is a loop for which identifies moduli.
IDENTIFYING = ("felupe",)
DOLFINX_PYTHONS = (sys.executable, "/usr/bin/python3")


def ours(certify: bool = False) -> ContenderSpec:
    """Palpate itself."""
    command = (sys.executable, "-m", "palpate.validate.bench.peers.ours")
    return ContenderSpec(
        "palpate", command, ("certify",) if certify else (), ("p1", "p1p1", "p2", "p2p0", "p2p1"), True
    )


def ours_that_identifies() -> ContenderSpec:
    """Palpate's identification."""
    return ContenderSpec("palpate", (sys.executable, "-m", "palpate.validate.bench.peers.ours_identify"))


def find_identifying_peers(
    peers_dir: Path | None, wanted: tuple[str, ...] | None, may_install: bool = True
) -> tuple[list[ContenderSpec], dict[str, str]]:
    """Loops that a user would write, as `find_peers`: FElupe's equilibria inside scipy's least squares, by both linear solvers."""
    if not _is_wanted("felupe", wanted):
        return [], {}
    python, reason = peer_python(peers_dir or default_folder(), may_install)
    if python is None:
        return [], {"felupe": reason}
    command = (str(python), str(PEERS / "felupe_identify.py"))
    name = "felupe in scipy's least squares"
    return [ContenderSpec(name, command), ContenderSpec(f"{name}, with pardiso", command, ("pardiso",))], {}


def find_peers(
    peers_dir: Path | None, wanted: tuple[str, ...] | None, may_install: bool = True
) -> tuple[list[ContenderSpec], dict[str, str]]:
    """Contenders that this machine has or can get, and for every other one why not. wanted : names to look for, None for all."""
    found: list[ContenderSpec] = []
    skipped: dict[str, str] = {}
    from_pypi = [n for n in ("felupe", "scikit-fem") if _is_wanted(n, wanted)]
    if from_pypi:
        python, reason = peer_python(peers_dir or default_folder(), may_install)
        for name in from_pypi:
            if python is None:
                skipped[name] = reason
                continue
            script = str(PEERS / ("felupe_peer.py" if name == "felupe" else "skfem_peer.py"))
            elements = ("p1", "p2") if name == "felupe" else ("p1", "p2", "p2p1")
            command = (str(python), script)
            found.append(ContenderSpec(name, command, (), elements))
            found.append(ContenderSpec(f"{name} with pardiso", command, ("pardiso",), elements))
    _add_calculix(found, skipped, wanted)
    _add_dolfinx(found, skipped, wanted)
    return found, skipped


def default_folder() -> Path:
    """In the user's cache; its name follows the requirements, so that other versions make another environment."""
    tag = hashlib.sha256("\n".join(REQUIREMENTS).encode()).hexdigest()[:12]
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return cache / "palpate" / f"bench-peers-{tag}"


def peer_python(folder: Path, may_install: bool = True) -> tuple[Path | None, str]:
    """The environment's Python, made if it is not there; or None and the reason."""
    python, done = folder / "bin" / "python", folder / "complete"
    if python.exists() and done.exists():
        return python, ""
    if not may_install:
        return None, f"its environment is not in {folder}; a bench that is not quick makes it"
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        subprocess.run(
            [sys.executable, "-m", "venv", "--clear", str(folder)], check=True, capture_output=True, timeout=300
        )
        install = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--retries", "1"]
        subprocess.run([*install, *REQUIREMENTS], check=True, capture_output=True, timeout=900)
    except subprocess.CalledProcessError as error:
        said = error.stderr.decode(errors="replace").strip().splitlines() or ["no message"]
        return None, f"its environment could not be made in {folder}: {said[-1][:200]}"
    except (OSError, subprocess.TimeoutExpired) as error:
        return None, f"its environment could not be made in {folder}: {str(error)[:200]}"
    done.touch()
    return python, ""


def _add_calculix(found: list[ContenderSpec], skipped: dict[str, str], wanted: tuple[str, ...] | None) -> None:
    if not _is_wanted("calculix", wanted):
        return
    if shutil.which("ccx") is None:
        skipped["calculix"] = "ccx is not installed (Debian: apt-get install calculix-ccx)"
        return
    # It needs numpy alone beside the ccx program, so our own Python serves.
    command = (sys.executable, str(PEERS / "calculix_peer.py"))
    found.append(ContenderSpec("calculix", command, (), ("p1", "p2"), steps_itself=True))


def _add_dolfinx(found: list[ContenderSpec], skipped: dict[str, str], wanted: tuple[str, ...] | None) -> None:
    if not _is_wanted("dolfinx", wanted):
        return
    for python in DOLFINX_PYTHONS:
        if not Path(python).exists():
            continue
        probe = subprocess.run([python, "-c", "import dolfinx, scipy"], capture_output=True, check=False)
        if probe.returncode == 0:
            found.append(ContenderSpec("dolfinx", (python, str(PEERS / "dolfinx_peer.py")), (), ("p1", "p2")))
            return
    skipped["dolfinx"] = "no Python here has it (Debian: apt-get install python3-dolfinx-real)"


def _is_wanted(name: str, wanted: tuple[str, ...] | None) -> bool:
    return wanted is None or name in wanted
