"""The blind check's simulator: its laws and element are right by themselves, and what it hides is there."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from palpate.core.errors import ConvergenceError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import sphere_in_cube
from palpate.core.fem.newton.newton import solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.laws.linear import LINEAR
from palpate.core.laws.mooney_rivlin import MOONEY_RIVLIN
from palpate.core.mesh import TetMesh
from palpate.imaging.volume import Volume
from palpate.validate.blind import cases
from palpate.validate.blind.cases import make_case
from palpate.validate.blind.noise_floor import noise_floor_mm, noise_whose_floor_is
from palpate.validate.blind.recipe import Recipe
from palpate.validate.blind.simulator.effects import LIBRARY, OUTSIDE
from palpate.validate.blind.simulator.fem import Body
from palpate.validate.blind.simulator.laws import Organ, Tissue
from palpate.validate.blind.simulator.newton import equilibrium, slopes_in
from palpate.validate.blind.simulator.patients import Rigid
from palpate.validate.blind.simulator.simulated_body import Simulated
from palpate.validate.blind.simulator.states import held_nodes, shown
from palpate.validate.blind.simulator.strength import TooWeak
from palpate.validate.blind.simulator.visibility import effect_rows, joint_mm, true_surfaces
from palpate.validate.blind.write_case import widened

RADII = np.array([12.0, 9.0, 15.0])
CENTRE = np.array([3.0, -2.0, 5.0])
ONE = np.ones(4)


@pytest.fixture(scope="module")
def body() -> Body:
    mesh = sphere_in_cube(2, 1, 2, 12.0, 30.0)
    left = mesh.points[mesh.cells].mean(axis=1)[:, 0] > 0.0
    return Body(mesh.points, mesh.cells, np.where(mesh.regions == 3, 3, np.where(left, 1, 2)))


@pytest.fixture(scope="module")
def boundary(body: Body) -> dict[str, np.ndarray]:
    """The cube's faces: one is a wall, the others the region's edge."""
    faces, _ = TetMesh(body.points, body.cells, body.regions).region_boundary((1, 2, 3))
    wall = (body.points[faces][:, :, 1] > 29.9).all(axis=1)
    return {"rectum": faces[wall], "outer": faces[~wall]}


@pytest.fixture
def plain(body: Body) -> Simulated:
    faces, _ = TetMesh(body.points, body.cells, body.regions).region_boundary((1, 2))
    return Simulated.plain(body, faces, {1: 20.0, 2: 50.0})


LAWS = [
    Organ(20 * ONE, 400 * ONE, 1.1 * ONE, 5 * ONE, (0.6, 0.0, 0.8)),
    Organ(20 * ONE, 400 * ONE, ONE, 0 * ONE),
    Tissue(20 * ONE, 400 * ONE, 1.05 * ONE, 7 * ONE, 3.0, (0.6, 0.0, 0.8)),
]


@pytest.mark.parametrize("law", LAWS, ids=["grown fibrous organ", "organ", "stiffening tissue"])
def test_the_tangent_is_the_stress_s_derivative(law: Organ | Tissue) -> None:
    F = np.eye(3) + 0.2 * np.random.default_rng(0).standard_normal((4, 3, 3))
    _, A = law.response(F)
    h = 1e-6
    for k in range(3):
        for m in range(3):
            step = np.zeros((3, 3))
            step[k, m] = h
            slope = (law.response(F + step)[0] - law.response(F - step)[0]) / (2.0 * h)
            np.testing.assert_allclose(A[..., k, m], slope, atol=1e-6 * np.abs(A).max())


@pytest.mark.parametrize("law", LAWS, ids=["grown fibrous organ", "organ", "stiffening tissue"])
def test_a_pressure_given_is_the_dilation_s_part_of_the_law(law: Organ | Tissue) -> None:
    F = np.eye(3) + 0.2 * np.random.default_rng(2).standard_normal((4, 3, 3))
    d = law.dilation(F)
    P, A = law.response(F, d.modulus * d.value)
    whole, tangent = law.response(F)
    np.testing.assert_allclose(P, whole, atol=1e-9 * np.abs(whole).max())
    A = A + np.einsum("p,pij,pkl->pijkl", d.modulus, d.slope, d.slope)
    np.testing.assert_allclose(A, tangent, atol=1e-9 * np.abs(tangent).max())


def test_the_organ_s_law_is_the_program_s_though_written_apart() -> None:
    F = np.eye(3) + 0.15 * np.random.default_rng(1).standard_normal((4, 3, 3))
    ours = Organ(20 * ONE, 400 * ONE, ONE, 0 * ONE).response(F)[0]
    np.testing.assert_allclose(ours, MOONEY_RIVLIN.stress(F, [5.0, 5.0, 200.0]), rtol=1e-10, atol=1e-9)


def test_a_body_whose_boundary_moves_evenly_is_strained_evenly(body: Body, boundary: dict[str, np.ndarray]) -> None:
    """The patch test: one material, u = H X on the boundary."""
    H = np.array([[0.03, 0.02, 0.0], [-0.01, -0.02, 0.04], [0.02, 0.0, 0.01]])
    held = np.full((len(body.nodes), 3), np.nan)
    for faces in boundary.values():
        nodes = np.unique(body.face_nodes(faces))
        held[nodes] = body.nodes[nodes] @ H.T
    q = 4 * len(body.cells)
    one = Organ(np.full(q, 20.0), np.full(q, 300.0), np.ones(q), np.zeros(q))
    u = equilibrium(Body(body.points, body.cells, np.ones_like(body.regions)), {1: one}, held)
    np.testing.assert_allclose(u, body.nodes @ H.T, atol=1e-7)


class Bulge:
    """The wall moves in by 4 mm in its middle."""

    def displacement(self, points: np.ndarray) -> np.ndarray:
        depth = np.exp(-((points[:, 0] / 15.0) ** 2) - (points[:, 2] / 15.0) ** 2)
        return np.column_stack([0.0 * depth, -4.0 * depth, 0.0 * depth])


def test_a_nearly_incompressible_body_bends_as_the_program_s_elements_do() -> None:
    """One pressure a cell is the program's p2p0 to the last digits, and near Taylor-Hood; with four it would be 24 % off."""
    mesh = sphere_in_cube(3, 2, 3, 12.0, 30.0)
    body = Body(mesh.points, mesh.cells, np.where(mesh.regions == 3, 3, 1))
    outside, _ = mesh.region_boundary((1, 2, 3))
    organ_faces, _ = TetMesh(body.points, body.cells, body.regions).region_boundary((1,))
    wall = (body.points[outside][:, :, 1] > 29.9).all(axis=1)
    held = held_nodes(body, {"rectum": outside[wall], "outer": outside[~wall]}, {"rectum": Bulge()})
    plain = Simulated.plain(body, organ_faces, {1: 20.0})
    u, organ = equilibrium(body, plain.laws(), held), np.unique(body.face_nodes(organ_faces))
    for element, allowed in (("p2p0", 1e-5), ("p2p1", 0.04)):
        space = Space.of(TetMesh(body.points, body.cells, body.regions), element)
        nearest, same = cKDTree(body.nodes).query(space.nodes)
        assert nearest.max() < 1e-9
        K = {region: float(plain.K[body.regions == region][0]) for region in (1, 3)}
        materials = {1: Material(MOONEY_RIVLIN, [5.0, 5.0, 0.5 * K[1]]), 3: Material(LINEAR, [20.0, K[3]])}
        assembler = Assembler(space, np.isnan(held[same]).ravel())
        found = solve_equilibrium(assembler, materials, np.nan_to_num(held[same]).ravel())
        there = np.zeros_like(u)
        there[same] = found.u
        assert np.abs(u - there)[organ].max() < allowed * np.abs(u[organ]).max(), element


# Each way in which an effect acts, once.
ALL_WAYS = sorted({*LIBRARY, *OUTSIDE} - {"inclusion", "unmodelled_load"})


def test_a_tangent_that_is_kept_is_that_of_the_law_at_hand(body: Body, plain: Simulated) -> None:
    """Linear tissue's is assembled once; other moduli, and the derivative of the force, must not see the old one."""
    u = 0.3 * np.sin(body.nodes / 9.0)
    stiffer = Simulated.plain(body, plain.organ_faces, {1: 20.0, 2: 50.0})
    stiffer.G = 1.5 * stiffer.G
    body.assemble(u, plain.laws())
    force, K = body.assemble(u, stiffer.laws())
    fresh = Body(body.points, body.cells, body.regions).assemble(u, stiffer.laws())
    np.testing.assert_array_equal(force, fresh[0])
    np.testing.assert_array_equal(K.data, fresh[1].data)
    way = np.random.default_rng(0).standard_normal(u.shape)
    ahead, behind = (body.assemble(u + h * way, stiffer.laws())[0] for h in (1e-5, -1e-5))
    np.testing.assert_allclose(K @ way.ravel(), (ahead - behind) / 2e-5, atol=1e-6 * np.abs(K @ way.ravel()).max())


def test_a_hidden_push_presses_inwards(body: Body, plain: Simulated) -> None:
    """What pulls at an organ is no push: scars and tears do, which are beside the library."""
    for seed in range(6):
        hidden = Simulated.plain(body, plain.organ_faces, {1: 20.0, 2: 50.0})
        LIBRARY["unmodelled_load"](hidden, 5.0, np.random.default_rng(seed))
        assert hidden.load is not None and hidden.centre is not None
        outwards = np.asarray(hidden.centre) - hidden.middle
        assert hidden.load.sum(axis=0) @ outwards < -0.5 * np.linalg.norm(hidden.load.sum(axis=0)) * np.linalg.norm(
            outwards
        )


@pytest.mark.parametrize("name", ALL_WAYS)
def test_every_hidden_effect_moves_or_redraws_the_organ(
    name: str, plain: Simulated, body: Body, boundary: dict[str, np.ndarray]
) -> None:
    hidden = Simulated.plain(body, plain.organ_faces, {1: 20.0, 2: 50.0})
    (LIBRARY | OUTSIDE)[name](hidden, 0.1, np.random.default_rng(3))
    wall = next(iter(hidden.wall_offsets), "rectum")
    parts = {"bone" if name == "bone_motion" else "outer": boundary["outer"], wall: boundary["rectum"]}
    rest, deformed = shown(hidden, parts, {wall: Bulge()})
    done, left = joint_mm([effect_rows(hidden, plain, parts, rest, deformed)])
    assert done > 1e-7  # gravity moves a body this small by next to nothing
    assert left <= done
    surfaces = true_surfaces(hidden, rest, deformed)
    points, faces = surfaces["points"], surfaces["faces"]
    assert np.isfinite(points).all()
    assert faces.max() < len(points) == len(surfaces["at_rest"])
    # At rest the scan shows the organ where no offset of the deformed contour and no motion between the scans is.
    corners = body.points[np.unique(hidden.organ_faces)] + rest.u[np.unique(hidden.organ_faces)]
    assert cKDTree(surfaces["at_rest"]).query(corners)[0].max() < 1e-12


def test_a_stiffness_s_slope_is_the_difference_quotient(
    plain: Simulated, body: Body, boundary: dict[str, np.ndarray]
) -> None:
    held = held_nodes(body, boundary, {"rectum": Bulge()})
    there = []
    for factor in (np.exp(-0.05), 1.0, np.exp(0.05)):
        other = Simulated.plain(body, plain.organ_faces, {1: 20.0 * float(factor), 2: 50.0})
        there.append(equilibrium(body, other.laws(), held))
    slope = slopes_in(body, plain.laws(), (1,), there[1], held)[0]
    expected = (there[2] - there[0]) / 0.1
    assert np.abs(slope - expected).max() < 0.02 * np.abs(expected).max()


def test_a_bone_that_reaches_the_region_s_edge_may_move(
    body: Body, plain: Simulated, boundary: dict[str, np.ndarray]
) -> None:
    """The edge beside it goes along, far away it stays; one that stayed everywhere folded the cells between."""
    faces = boundary["outer"]
    bone = (body.points[faces][:, :, 0] > 29.9).all(axis=1)
    sides = {"bone": faces[bone], "outer": faces[~bone]}
    motion = Rigid(np.array([0.0, 0.0, 12.0]), np.zeros(3), CENTRE)
    held = held_nodes(body, sides, {"bone": motion})
    edge = np.unique(body.face_nodes(sides["outer"]))
    X = body.nodes[edge]
    np.testing.assert_allclose(held[edge][X[:, 0] > 29.9], [[0.0, 0.0, 12.0]] * int((X[:, 0] > 29.9).sum()))
    assert np.abs(held[edge][X[:, 0] < -29.9]).max() < 0.01
    assert np.linalg.det(body.gradients(equilibrium(body, plain.laws(), held))).min() > 0.1


def test_a_rigid_motion_keeps_distances() -> None:
    X = np.random.default_rng(4).standard_normal((6, 3)) * 20.0
    motion = Rigid(np.array([1.0, -2.0, 0.5]), np.array([0.1, 0.2, -0.3]), np.array([3.0, 4.0, 5.0]))
    Y = X + motion.displacement(X)
    distances = [np.linalg.norm(Z[:, None] - Z, axis=2) for Z in (X, Y)]
    np.testing.assert_allclose(distances[0], distances[1], atol=1e-10)


def ball(points: np.ndarray) -> np.ndarray:
    """An ellipsoid of two halves in tissue."""
    x = (points - CENTRE) / RADII
    inside = (x**2).sum(axis=1) < 1.0
    return np.where(inside, np.where(points[:, 0] > CENTRE[0], 1, 2), 3).astype(np.uint8)


@pytest.mark.parametrize("offset", [1.2, -1.0])
def test_a_widened_contour_lies_that_far_outside(offset: float) -> None:
    affine = np.diag([-1.0, 1.1, 1.5, 1.0])  # an axis that runs the other way
    affine[:3, 3] = [25.0, -22.0, -20.0]
    grid = Volume(np.zeros((45, 40, 34), dtype=np.uint8), affine)
    labels = widened(ball, grid, lambda normals: np.full(len(normals), offset))
    along = np.eye(3)
    for axis in range(3):
        for sign in (-1.0, 1.0):
            edge = CENTRE + sign * (RADII[axis] + offset) * along[axis] + np.array([0.7, 0.0, 0.0]) * (axis > 0)
            inner, outer = edge - 0.45 * sign * along[axis], edge + 0.45 * sign * along[axis]
            assert labels(inner[None])[0] in (1, 2), (axis, sign)
            assert labels(outer[None])[0] == 3, (axis, sign)


def test_a_contour_widened_on_one_side_stays_on_the_other() -> None:
    affine = np.diag([1.0, 1.0, 1.0, 1.0])
    affine[:3, 3] = [-18.0, -20.0, -18.0]
    grid = Volume(np.zeros((44, 38, 48), dtype=np.uint8), affine)
    labels = widened(ball, grid, lambda normals: 2.0 * np.clip(normals[:, 0], 0.0, None) ** 2)
    beside = np.array([0.0, 0.6, 0.0])
    assert labels(CENTRE + [[RADII[0] + 1.4, 0.0, 0.0]] + beside)[0] == 1
    assert labels(CENTRE - [[RADII[0] + 0.6, 0.0, 0.0]] + beside)[0] == 3


@dataclass
class _Shows:
    """A simulated patient who shows so much of an effect, mm."""

    effect_mm: tuple[float, float]


@pytest.mark.parametrize(
    ("wanted", "left", "noise"),
    [(1.2, 2.0, 0.3), (1.2, 0.9, 0.225), (0.6, 0.35, 0.127), (1.2, 0.311, 0.058), (1.2, 0.309, 0.052)],
)
def test_contours_are_drawn_better_where_an_effect_shows_less_than_it_shall(
    wanted: float, left: float, noise: float
) -> None:
    recipe = Recipe("x", 1, {"inclusion": 2.0}, noise_mm=0.3, shown_mm=wanted, least_noise_mm=0.05)
    assert cases._noise_mm(recipe, _Shows((9.0, left))) == pytest.approx(noise, abs=6e-4)  # type: ignore[arg-type]
    plain = replace(recipe, effects={})
    assert cases._noise_mm(plain, _Shows((0.0, 0.0))) == 0.3  # type: ignore[arg-type]


def test_an_effect_shows_above_the_noise_floor_or_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recipe = Recipe("x", 1, {"inclusion": 2.0}, noise_mm=0.3, shown_mm=0.6, least_noise_mm=0.12)
    least = noise_floor_mm(0.12)
    for left in np.linspace(1.001 * least, 0.6, 7).tolist():
        floor = noise_floor_mm(cases._noise_mm(recipe, _Shows((9.0, left))))  # type: ignore[arg-type]
        assert least - 1e-3 <= floor <= left + 1e-3
    below = _Shows((9.0, 0.99 * least))
    monkeypatch.setattr(
        cases, "simulated", lambda *_: (replace(recipe, noise_mm=cases._noise_mm(recipe, below)), below)
    )
    with pytest.raises(TooWeak, match=r"0.34 mm are left"):
        make_case(recipe, tmp_path / "case", tmp_path / "answers")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("noise", [0.12, 0.4])
def test_a_floor_has_its_noise(noise: float) -> None:
    assert noise_whose_floor_is(noise_floor_mm(noise)) == pytest.approx(noise)
    assert noise_whose_floor_is(0.2) == 0.0


@pytest.mark.parametrize("name", ["volume_change", "shrunken_tissue"])
def test_what_has_grown_is_in_the_same_equilibrium_whichever_way_it_got_there(
    name: str, plain: Simulated, boundary: dict[str, np.ndarray]
) -> None:
    """From the deformed plain body by way of softer bulk moduli, and from rest, boundary and growth step by step."""
    grown = copy.copy(plain)
    (LIBRARY | OUTSIDE)[name](grown, 0.1, np.random.default_rng(1))
    held = held_nodes(plain.body, boundary, {"rectum": Rigid(np.array([0.0, -3.0, 0.0]), np.zeros(3), CENTRE)})
    near = equilibrium(plain.body, plain.laws(), held)
    there = equilibrium(plain.body, grown.laws(), held, start=near)
    np.testing.assert_allclose(there, equilibrium(plain.body, grown.laws(), held), atol=1e-5)
    assert np.abs(there - near).max() > 0.1


def test_an_organ_may_swell_by_a_third(plain: Simulated, boundary: dict[str, np.ndarray]) -> None:
    """More than Newton gets to in load steps, which the pressure of the growth not yet taken up buckles."""
    grown = copy.copy(plain)
    LIBRARY["volume_change"](grown, 0.35, np.random.default_rng(0))
    held = held_nodes(plain.body, boundary, {})
    u = equilibrium(plain.body, grown.laws(), held, start=np.zeros_like(plain.body.nodes))
    volume = (np.linalg.det(plain.body.gradients(u)) * plain.body.weights).sum(axis=1)[plain.in_organ].sum()
    before = plain.body.weights.sum(axis=1)[plain.in_organ].sum()
    assert volume / before == pytest.approx(float(grown.growth[plain.in_organ][0]) ** 3, abs=0.02)
    with pytest.raises(ConvergenceError, match="what has grown in it"):
        LIBRARY["volume_change"](grown, 40.0, np.random.default_rng(0))
        equilibrium(plain.body, grown.laws(), held, start=np.zeros_like(plain.body.nodes))


def test_a_wall_that_lies_against_bone_goes_with_it(
    body: Body, plain: Simulated, boundary: dict[str, np.ndarray]
) -> None:
    """What the scans show of the wall, and so what a diagnosis is given of it, is its own motion and the bone's."""
    faces = boundary["outer"]
    bone = (body.points[faces][:, :, 0] > 29.9).all(axis=1)
    sides = {"bone": faces[bone], "rectum": boundary["rectum"], "outer": faces[~bone]}
    hidden = copy.copy(plain)
    hidden.bone = Rigid(np.array([0.0, 0.0, 2.0]), np.zeros(3), CENTRE)
    own = Rigid(np.array([0.0, -1.0, 0.0]), np.zeros(3), CENTRE)
    rest, deformed = shown(hidden, sides, {"rectum": own})
    assert not rest.u.any()
    moved = deformed.motions["rectum"].displacement(
        np.array([[30.0, 30.0, 0.0], [20.0, 30.0, 0.0], [-30.0, 30.0, 0.0]])
    )
    np.testing.assert_allclose(moved[:, :2], [[0.0, -1.0]] * 3, atol=1e-9)
    np.testing.assert_allclose(moved[:, 2], [2.0, 2.0 * np.exp(-0.5), 0.0], atol=1e-6)
    at = np.unique(body.face_nodes(sides["rectum"]))
    inner = at[(np.abs(body.nodes[at]) < 29.9).sum(axis=1) == 2]
    np.testing.assert_allclose(deformed.u[inner], deformed.motions["rectum"].displacement(body.nodes[inner]), atol=1e-9)
