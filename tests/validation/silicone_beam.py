"""Makes a case of the silicone beam's motion capture (../shared/data/silicone_beam; its README gives frames, loads and errors).

usage: python tests/validation/silicone_beam.py DATA CASE [STATE ...]
"""

from __future__ import annotations

import csv
import json
import struct
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyvista as pv

# Tip load in N and repeatability in mm (rms over root two) of each state's files.
STATES = {"gravity": (0.0, 0.32), "load52": (0.510, 0.75), "load101": (1.001, 1.25)}
# Marker centres by design, mm: the tip's.
TIP = {"tip_1": (0.0, 15.0, 36.0), "tip_2": (0.0, -6.0, 24.0), "tip_3": (0.0, 36.0, 6.0)}
BASE = ((-94.0, -10.0, -1.0), (-94.0, 40.0, 27.5), (-94.0, 40.0, 0.0))
GRAVITY = [0.0, 0.0, -9.81]


def read_c3d(path: Path) -> np.ndarray:
    """Markers (frames, markers, 3) mm in the beam's axes, of a C3D file of floats in little-endian order."""
    raw = path.read_bytes()
    _, markers, _, first, last, _ = struct.unpack("<6h", raw[:12])
    start = 512 * (struct.unpack("<h", raw[16:18])[0] - 1)
    frames = last - first + 1
    values = np.frombuffer(raw[start : start + 16 * frames * markers], "<f4").reshape(frames, markers, 4)
    x = 1000.0 * values[..., :3].astype(float)
    return np.stack([x[..., 2], -x[..., 1], x[..., 0]], axis=-1)


def moved(data: Path, state: str) -> np.ndarray:
    """(3, 3) mm: the tip markers' motion from held straight (first 0.2 s) to rest (last second), mean of both repeats."""
    motions = []
    for run in "ab":
        x = read_c3d(data / f"beam_{state}_V2_{run}.c3d")
        straight = x[:20].mean(axis=0)
        motions.append((x[-100:, :3].mean(axis=0) - straight[:3]) @ turned(straight).T)
    return np.mean(motions, axis=0)


def turned(straight: np.ndarray) -> np.ndarray:
    """(3, 3) rotation that brings the six markers of the beam held straight to where they are by design (Kabsch 1976)."""
    wanted = np.array([*TIP.values(), *BASE])
    U, _, Vt = np.linalg.svd((straight - straight.mean(axis=0)).T @ (wanted - wanted.mean(axis=0)))
    return (U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt).T


def make_case(data: Path, case: Path, states: Sequence[str] = tuple(STATES)) -> Path:
    """The case folder, gravity known but left out of the model."""
    case.mkdir(parents=True)
    body = pv.read(data / "beam.stl")
    body.points = np.asarray(body.points)[:, [2, 0, 1]] - [100.0, 0.0, 0.0]
    body.save(case / "body.stl")
    rows = []
    for name in states:
        load, sd = STATES[name]
        with (case / f"{name}.csv").open("w", newline="") as stream:
            out = csv.writer(stream)
            out.writerow(["name", "rest_x", "rest_y", "rest_z", "deformed_x", "deformed_y", "deformed_z"])
            for (marker, rest), v in zip(TIP.items(), moved(data, name), strict=True):
                out.writerow([marker, *rest, *np.round(np.add(rest, v), 4)])
        loads = [{"name": "weight", "at": [0.0, 15.0, 36.0], "force_n": [0.0, 0.0, -load]}] if load else []
        rows.append({"name": name, "points": f"{name}.csv", "points_sd_mm": sd, "gravity": GRAVITY, "loads": loads})
    clamp = {"name": "clamp", "plane_point": [-100.0, 0.0, 0.0], "plane_normal": [1.0, 0.0, 0.0], "tolerance_mm": 0.5}
    facts = {
        "name": "silicone_beam",
        "organ_shear_modulus_bounds_kpa": [5.0, 500.0],
        "body": "body.stl",
        "density_kg_m3": 1070.0,
        "supports": [clamp],
        "states": rows,
        "model_gravity": False,
    }
    (case / "case.json").write_text(json.dumps(facts, indent=1) + "\n")
    return case


if __name__ == "__main__":
    make_case(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:] or tuple(STATES))
