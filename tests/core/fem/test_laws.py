"""Laws against finite differences and against closed forms that are written in principal stretches, not in F."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from law_derivatives import derivative_errors
from scipy.optimize import brentq

from palpate.core.errors import InputError
from palpate.core.laws import LAWS, Law, mooney_rivlin_parameters
from palpate.validate.forward.random_scenes import random_deformation_gradients

NOT_OBJECTIVE = {"linear", "linear-stiffening"}
ISOTROPIC_FINITE = ["mooney-rivlin", "mooney-rivlin-printed", "neo-hookean"]
ALL = sorted(LAWS)


def random_parameters(law: Law, seed: int = 0) -> np.ndarray:
    """Between 5 and 500 kPa, all different, so that no two terms can stand in for each other."""
    return np.random.default_rng(seed).uniform(5.0, 500.0, len(law.parameters))


@pytest.mark.parametrize("name", ALL)
def test_derivatives_of_every_law_agree_with_finite_differences(name: str) -> None:
    law = LAWS[name]
    errors = derivative_errors(law, random_parameters(law), random_deformation_gradients(1000, seed=1))
    assert errors.stress < 1e-8
    assert errors.tangent < 1e-7
    assert errors.asymmetry < 1e-12
    assert errors.parameter_linearity < 1e-12


@pytest.mark.parametrize("name", ALL)
def test_mixed_parts_add_up_to_the_whole_law(name: str) -> None:
    """W and g, which mixed elements use, against psi; kappa and G against the small-strain tangent."""
    law = LAWS[name]
    p = random_parameters(law, 3)
    identity = np.eye(3)[None]
    A = law.tangent(identity, p)[0]
    kappa, G = law.kappa_of(p[None])[0], law.shear_modulus_of(p[None])[0]
    g_slope = law.evaluate(identity[None], p[None], 1).G[0, 0]
    assert law.energy(identity, p)[0] == pytest.approx(0.0, abs=1e-13)
    assert np.abs(law.stress(identity, p)).max() < 1e-11
    assert A[1, 1] == pytest.approx(G, rel=1e-12)  # d P_12 / d F_12
    assert A[0, 0] - A[0, 4] == pytest.approx(2.0 * G, rel=1e-12)
    bulk = kappa * g_slope[0, 0] ** 2
    assert (A[0, 0] + 2.0 * A[0, 4]) / 3.0 == pytest.approx(bulk, rel=1e-12)


@pytest.mark.parametrize("name", ALL)
def test_an_organ_of_any_law_has_the_moduli_that_are_asked_for(name: str) -> None:
    law = LAWS[name]
    p = law.of_moduli(30.0, 800.0)
    A = law.tangent(np.eye(3)[None], p)[0]
    assert A[1, 1] == pytest.approx(30.0, rel=1e-12) and (A[0, 0] + 2.0 * A[0, 4]) / 3.0 == pytest.approx(800.0)
    np.testing.assert_allclose(law.of_moduli(60.0, 1600.0), 2.0 * p, rtol=1e-12)
    if name == "mooney-rivlin":
        assert p.tolist() == mooney_rivlin_parameters(30.0, 800.0).tolist()


def test_a_law_without_a_shear_modulus_is_no_organs() -> None:
    with pytest.raises(InputError, match="law 'fluid' has no shear and bulk modulus of its own"):
        replace(LAWS["neo-hookean"], name="fluid", shear_modulus_of=lambda p: 0.0 * p[:, 0]).of_moduli(1.0, 1.0)


@pytest.mark.parametrize("name", [n for n in ALL if n not in NOT_OBJECTIVE])
def test_a_rotation_changes_neither_energy_nor_tangent_beyond_turning_them(name: str) -> None:
    law = LAWS[name]
    p, F = random_parameters(law, 4), random_deformation_gradients(50, seed=5)
    R = random_deformation_gradients(50, seed=6, stretch=(1.0, 1.0))
    np.testing.assert_allclose(law.energy(R @ F, p), law.energy(F, p), rtol=1e-12)
    np.testing.assert_allclose(law.stress(R @ F, p), R @ law.stress(F, p), atol=1e-9)
    np.testing.assert_allclose(law.energy(F @ R, p), law.energy(F, p), rtol=1e-12, err_msg="not isotropic")


@pytest.mark.parametrize("name", [n for n in ALL if LAWS[n].needs_positive_jacobian])
def test_a_guarded_law_gives_infinite_energy_where_it_is_not_defined(name: str) -> None:
    law = LAWS[name]
    F = np.stack([np.diag([-1.0, 1.0, 1.0]), np.diag([0.0, 1.0, 1.0])])
    assert np.isposinf(law.energy(F, random_parameters(law))).all()


# Closed forms. Cauchy stress of mu1 (I2bar - 3) + mu2 (I1bar - 3) + U(J) in principal stretches (Holzapfel 2000, Eq 6.69 ff).


def constants(name: str) -> tuple[np.ndarray, float, float, object]:
    """Parameters p, c1 (of I1bar), c2 (of I2bar), and dU/dJ of a law that is Mooney-Rivlin in some form."""
    mu1, mu2, v1 = 7.0, 11.0, 310.0
    if name == "neo-hookean":
        return np.array([2.0 * mu2, 2.0 * v1]), mu2, 0.0, lambda J: 2.0 * v1 * (J - 1.0)
    p = np.array([mu1, mu2, v1])
    if name == "mooney-rivlin":
        return p, mu2, mu1, lambda J: 2.0 * v1 * (J - 1.0)
    return p, mu2, mu1, lambda J: 4.0 / 3.0 * v1 * (J ** (2.0 / 3.0) - 1.0) * J ** (-1.0 / 3.0)


def principal_cauchy(name: str, stretches: np.ndarray) -> np.ndarray:
    _, c1, c2, dU = constants(name)
    J = float(np.prod(stretches))
    bar = (stretches * J ** (-1.0 / 3.0)) ** 2
    return (2.0 / J) * (c1 * (bar - bar.mean()) - c2 * (1.0 / bar - (1.0 / bar).mean())) + dU(J)  # type: ignore[operator]


def nominal(name: str, stretches: np.ndarray) -> np.ndarray:
    """First Piola-Kirchhoff principal stresses of the closed form."""
    return principal_cauchy(name, stretches) * np.prod(stretches) / stretches


def free_stretch(name: str, stretches_of: object, index: int) -> np.ndarray:
    """Stretches whose stress in direction `index` vanishes."""
    root = brentq(lambda x: principal_cauchy(name, stretches_of(x))[index], 0.4, 2.5, xtol=1e-15, rtol=1e-15)  # type: ignore[operator]
    return stretches_of(root)  # type: ignore[operator,no-any-return]


MODES = {
    "uniaxial": (lambda s, x: np.array([s, x, x]), 2),
    "equibiaxial": (lambda s, x: np.array([s, s, x]), 2),
    "pure shear": (lambda s, x: np.array([s, 1.0, x]), 2),
}


@pytest.mark.parametrize("stretch", [0.7, 0.95, 1.1, 1.6])
@pytest.mark.parametrize("mode", sorted(MODES))
@pytest.mark.parametrize("name", ISOTROPIC_FINITE)
def test_stretched_block_matches_the_closed_form(name: str, mode: str, stretch: float) -> None:
    shape, free = MODES[mode]
    stretches = free_stretch(name, lambda x: shape(stretch, x), free)
    p = constants(name)[0]
    P = LAWS[name].stress(np.diag(stretches), p)[0]
    expected = nominal(name, stretches)
    assert np.abs(P - np.diag(expected)).max() < 1e-10 * np.abs(expected).max()


@pytest.mark.parametrize("gamma", [-0.8, 0.05, 0.6])
@pytest.mark.parametrize("name", ISOTROPIC_FINITE)
def test_simple_shear_matches_the_closed_form(name: str, gamma: float) -> None:
    """At J = 1: sigma_12 = 2 (c1 + c2) gamma, sigma_11 - sigma_22 = 2 (c1 + c2) gamma^2, sigma_22 - sigma_33 = -2 c2 gamma^2."""
    p, c1, c2, _ = constants(name)
    F = np.eye(3)
    F[0, 1] = gamma
    sigma = LAWS[name].stress(F, p)[0] @ F.T
    assert sigma[0, 1] == pytest.approx(2.0 * (c1 + c2) * gamma, rel=1e-10)
    assert sigma[0, 0] - sigma[1, 1] == pytest.approx(2.0 * (c1 + c2) * gamma**2, rel=1e-10)
    assert sigma[1, 1] - sigma[2, 2] == pytest.approx(-2.0 * c2 * gamma**2, rel=1e-10, abs=1e-10)
    assert sigma[0, 0] + sigma[1, 1] + sigma[2, 2] == pytest.approx(
        0.0, abs=1e-10
    )  # the volumetric part is silent at J = 1


def lame(G: float, K: float) -> tuple[float, float, float]:
    """Lame's lambda, Young's modulus and Poisson's ratio."""
    return K - 2.0 * G / 3.0, 9.0 * K * G / (3.0 * K + G), (3.0 * K - 2.0 * G) / (2.0 * (3.0 * K + G))


@pytest.mark.parametrize("strain", [-0.2, 0.3])
def test_linear_law_matches_hooke(strain: float) -> None:
    G, K = 20.0, 75.0
    _, E, nu = lame(G, K)
    law, p = LAWS["linear"], np.array([G, K])
    uniaxial = law.stress(np.diag(1.0 + strain * np.array([1.0, -nu, -nu])), p)[0]
    np.testing.assert_allclose(uniaxial, np.diag([E * strain, 0.0, 0.0]), atol=1e-10 * E)
    lateral = -2.0 * nu / (1.0 - nu)
    equibiaxial = law.stress(np.diag(1.0 + strain * np.array([1.0, 1.0, lateral])), p)[0]
    np.testing.assert_allclose(equibiaxial, np.diag([1.0, 1.0, 0.0]) * E / (1.0 - nu) * strain, atol=1e-10 * E)
    pure = law.stress(np.diag(1.0 + strain * np.array([1.0, 0.0, -nu / (1.0 - nu)])), p)[0]
    np.testing.assert_allclose(pure, np.diag([1.0, nu, 0.0]) * E / (1.0 - nu**2) * strain, atol=1e-10 * E)
    shear = np.eye(3)
    shear[0, 1] = strain
    expected = np.zeros((3, 3))
    expected[0, 1] = expected[1, 0] = G * strain
    np.testing.assert_allclose(law.stress(shear, p)[0], expected, atol=1e-10 * E)


def test_every_law_in_the_folder_is_found_by_name() -> None:
    assert {"mooney-rivlin", "mooney-rivlin-printed", "neo-hookean", "linear"} <= set(LAWS)
    assert all(LAWS[name].name == name for name in LAWS)
