"""The equation of motion of a tree of links, against Lagrange's equations of its points."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pam_model.body.hinge_tree import N_LINK_SCRATCH, mass_and_bias
from pam_model.body.link import Link, link_numbers
from pam_model.errors import PamError

PARENTS = {
    "hinge": (-1,),
    "pair": (-1, 0),
    "chain": (-1, 0, 1, 2),
    "branched": (-1, 0, 0, 2, 1),
    "all on the base": (-1, -1, -1),
}
GRAVITY = np.array([1.0, -2.0, -9.0])
STEP = 1e-4


def drawn_tree(parents: tuple[int, ...], seed: int = 3) -> list[Link]:
    """Links of random shape; each is a cloud of four points, so that its inertia is a body's."""
    draw = np.random.default_rng(seed)
    links = []
    for parent in parents:
        points, masses = draw.normal(size=(4, 3)), draw.uniform(0.1, 1.0, 4)
        centre = masses @ points / masses.sum()
        arms = points - centre
        inertia = sum(
            m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, arms, strict=True)
        )
        turned = Rotation.from_rotvec(draw.normal(size=3)).as_matrix()
        links.append(Link(parent, turned, draw.normal(size=3), masses.sum(), centre, inertia))
    return links


def motion_of(links: list[Link], angles: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Centre of mass and orientation of each link."""
    frames: list[tuple[np.ndarray, np.ndarray]] = []
    for link, angle in zip(links, angles, strict=True):
        origin, turned = (np.zeros(3), np.eye(3)) if link.parent < 0 else frames[link.parent]
        own = Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix()
        frames.append((origin + turned @ link.place, turned @ link.rotation @ own))
    return [
        (origin + turned @ link.centre, turned)
        for link, (origin, turned) in zip(links, frames, strict=True)
    ]


def lagrangian(links: list[Link], angles: np.ndarray, speeds: np.ndarray) -> float:
    """Kinetic minus potential energy, by central differences of the links' motion [J]."""
    after = motion_of(links, angles + STEP * speeds)
    before = motion_of(links, angles - STEP * speeds)
    energy = 0.0
    for link, (c1, r1), (c0, r0), (centre, turned) in zip(
        links, after, before, motion_of(links, angles), strict=True
    ):
        velocity = (c1 - c0) / (2.0 * STEP)
        spin = turned.T @ (r1 - r0) / (2.0 * STEP)
        omega = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
        energy += 0.5 * link.mass * velocity @ velocity + 0.5 * omega @ link.inertia @ omega
        energy += link.mass * GRAVITY @ centre
    return float(energy)


def mass_and_bias_of(
    links: list[Link], angles: np.ndarray, speeds: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    n = len(links)
    mass, bias = np.zeros((n, n)), np.zeros(n)
    scratch = np.zeros((n, N_LINK_SCRATCH))
    mass_and_bias(link_numbers(links), GRAVITY, angles, speeds, scratch, mass, bias)
    return mass, bias


@pytest.mark.parametrize("parents", PARENTS.values(), ids=PARENTS)
def test_mass_matrix_and_bias_are_those_of_lagrange(parents: tuple[int, ...]) -> None:
    links, draw = drawn_tree(parents), np.random.default_rng(1)
    n, unit = len(parents), np.eye(len(parents))
    angles, speeds = draw.normal(size=n), draw.normal(size=n)
    mass, bias = mass_and_bias_of(links, angles, speeds)

    def at(q: np.ndarray, v: np.ndarray) -> float:
        return lagrangian(links, q, v)

    still = at(angles, np.zeros(n))
    kinetic = [[at(angles, unit[i] + unit[j]) for j in range(n)] for i in range(n)]
    single = np.array([at(angles, unit[i]) - still for i in range(n)])
    shared = np.array(kinetic) - still - single[:, None] - single[None, :]
    np.testing.assert_allclose(mass, shared, rtol=1e-6, atol=1e-6 * np.abs(mass).max())
    e = 1e-3
    # d/dt(dL/dv) - dL/dq without acceleration, L being of second order in the speeds
    momentum = [
        (mass_and_bias_of(links, angles + s * e * speeds, speeds)[0] @ speeds) for s in (1, -1)
    ]
    slope = [
        (at(angles + e * unit[i], speeds) - at(angles - e * unit[i], speeds)) / (2 * e)
        for i in range(n)
    ]
    lagrange = (momentum[0] - momentum[1]) / (2 * e) - slope
    np.testing.assert_allclose(bias, lagrange, atol=1e-4 * np.abs(bias).max())


def test_a_pair_in_a_plane_is_the_double_pendulum_of_the_textbook() -> None:
    """Two rods of 1 kg and 1 m with their masses at the ends."""
    tip = np.array([1.0, 0.0, 0.0])
    links = [Link(mass=1.0, centre=tip), Link(0, place=tip, mass=1.0, centre=tip)]
    q, v = np.array([0.4, -0.9]), np.array([1.3, -0.7])
    n = np.zeros((2, 2)), np.zeros(2)
    mass_and_bias(
        link_numbers(links), np.array([0.0, -9.8, 0.0]), q, v, np.zeros((2, N_LINK_SCRATCH)), *n
    )
    c, s = np.cos(q[1]), np.sin(q[1])
    np.testing.assert_allclose(n[0], [[3.0 + 2.0 * c, 1.0 + c], [1.0 + c, 1.0]], rtol=1e-14)
    weight = 9.8 * np.array([2.0 * np.cos(q[0]) + np.cos(q.sum()), np.cos(q.sum())])
    spin = np.array([-s * (2.0 * v[0] * v[1] + v[1] ** 2), s * v[0] ** 2])
    np.testing.assert_allclose(n[1], weight + spin, rtol=1e-13)


@pytest.mark.parametrize(
    ("link", "said"),
    [
        (Link(0), "parent 0, expected -1"),
        (Link(rotation=2.0 * np.eye(3)), "not a rotation"),
        (Link(mass=-1.0), "mass of 0 kg or more"),
        (Link(place=np.zeros(2)), r"place must have shape \(3,\)"),
        (Link(mass=1.0, inertia=np.diag([1.0, 1.0, 3.0])), "no body has the principal moments"),
        (Link(centre=np.array([0.0, np.nan, 0.0])), "finite"),
    ],
)
def test_what_no_link_can_be_is_refused(link: Link, said: str) -> None:
    with pytest.raises(PamError, match=said):
        link_numbers([link])
