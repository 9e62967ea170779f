"""A body that is touched, as a file between processes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from palpate.applications.touch.body import Body
from palpate.core.files.atomic import atomic_path
from palpate.core.mesh import TetMesh


def save_body(path: Path, body: Body) -> None:
    """A body as an npz without pickle."""
    facts = {
        "shear_kpa": body.shear_kpa, "names": body.names, "support": body.support, "tissue_kpa": body.tissue_kpa,
        "poisson_ratio": body.poisson_ratio, "interval_kpa": body.interval_kpa,
    }  # fmt: skip
    m = body.mesh
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        np.savez(stream, points=m.points, cells=m.cells, regions=m.regions, facts=np.array(json.dumps(facts)))


def load_body(path: Path) -> Body:
    """What `save_body` wrote."""
    with np.load(path, allow_pickle=False) as file:
        mesh = TetMesh(file["points"], file["cells"], file["regions"])
        facts = json.loads(str(file["facts"]))
    by_region = ({int(k): v for k, v in facts.pop(key).items()} for key in ("shear_kpa", "names", "interval_kpa"))
    shear, names, interval = by_region
    return Body(mesh, shear, names, interval_kpa=interval, **facts)
