"""A tree of rigid links on hinges: mass matrix and bias torques.

    M(q) dv/dt + h(q, v) = torques of the joints,    h: gravity, centrifugal and Coriolis torques

Link i turns about the z axis of its hinge, relative to an earlier link or the base. All vectors are
in the base frame, and spatial vectors refer to its origin; so nothing is transformed on the way
back through the tree.

Source: R. Featherstone, Rigid Body Dynamics Algorithms, 2008: recursive Newton-Euler algorithm
(section 5.3) and composite-rigid-body algorithm (6.2).
"""

from __future__ import annotations

import math
from typing import Any, Final

# --- numbers of a link ---------------------------------------------------------------------------
L_PARENT: Final = 0
"""Index of the link that carries the hinge, -1 for the base."""
L_ROTATION: Final = 1
"""Hinge frame at q = 0 in the parent's frame, row by row (9 numbers)."""
L_PLACE: Final = 10
"""Origin of the hinge in the parent's frame [m] (3)."""
L_MASS: Final = 13
"""[kg]."""
L_CENTRE: Final = 14
"""Centre of mass in the link's frame [m] (3)."""
L_INERTIA: Final = 17
"""Inertia about the centre of mass [kg m^2]: xx, yy, zz, xy, xz, yz (6)."""
N_LINK_NUMBERS: Final = 23

# --- scratch memory of a link --------------------------------------------------------------------
_R = 0  # rotation, 9
_O = 9  # origin of the hinge, 3
_S = 12  # origin x axis: linear part of the hinge's motion, 3
_W = 15  # angular velocity, 3
_V = 18  # velocity of the point of the link at the origin of the base, 3
_DW = 21  # angular acceleration without dv/dt, 3
_DV = 24  # spatial linear acceleration without dv/dt, minus gravity, 3
_M = 27  # mass of the link and all that it carries
_MC = 28  # first moment of mass, 3
_I = 31  # inertia about the origin of the base, 6
_F = 37  # force, 3
_N = 40  # moment about the origin of the base, 3
N_LINK_SCRATCH: Final = 43


def cross(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float
) -> tuple[float, float, float]:
    """Cross product of two vectors."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


def place_link(link: Any, angle: float, w: Any, parent: Any, on_base: bool) -> None:
    """Write rotation, origin and hinge motion of a link into `w`, from those of its parent."""
    c, s = math.cos(angle), math.sin(angle)
    for i in range(3):
        at = L_ROTATION + 3 * i
        x = link[at] * c + link[at + 1] * s
        y = link[at + 1] * c - link[at] * s
        w[_R + 3 * i], w[_R + 3 * i + 1], w[_R + 3 * i + 2] = x, y, link[at + 2]
        w[_O + i] = link[L_PLACE + i]
    if not on_base:
        for j in range(3):
            x, y, z = w[_R + j], w[_R + 3 + j], w[_R + 6 + j]
            for i in range(3):
                at = _R + 3 * i
                w[at + j] = parent[at] * x + parent[at + 1] * y + parent[at + 2] * z
        x, y, z = w[_O], w[_O + 1], w[_O + 2]
        for i in range(3):
            at = _R + 3 * i
            turned = parent[at] * x + parent[at + 1] * y + parent[at + 2] * z
            w[_O + i] = parent[_O + i] + turned
    w[_S], w[_S + 1], w[_S + 2] = cross(
        w[_O], w[_O + 1], w[_O + 2], w[_R + 2], w[_R + 5], w[_R + 8]
    )


def move_link(speed: float, w: Any, parent: Any, on_base: bool, gravity: Any) -> None:
    """Write velocity and acceleration (without dv/dt) of a link."""
    for i in range(3):
        w[_W + i] = w[_R + 2 + 3 * i] * speed + (0.0 if on_base else parent[_W + i])
        w[_V + i] = w[_S + i] * speed + (0.0 if on_base else parent[_V + i])
    zx, zy, zz = w[_R + 2], w[_R + 5], w[_R + 8]
    ax, ay, az = cross(w[_W], w[_W + 1], w[_W + 2], zx, zy, zz)
    bx, by, bz = cross(w[_W], w[_W + 1], w[_W + 2], w[_S], w[_S + 1], w[_S + 2])
    cx, cy, cz = cross(w[_V], w[_V + 1], w[_V + 2], zx, zy, zz)
    turn = (ax, ay, az)
    pull = (bx + cx, by + cy, bz + cz)
    for i in range(3):
        w[_DW + i] = turn[i] * speed + (0.0 if on_base else parent[_DW + i])
        w[_DV + i] = pull[i] * speed + (-gravity[i] if on_base else parent[_DV + i])


def load_link(link: Any, w: Any) -> None:
    """Write mass, moments of mass, and the force that the link's own motion needs."""
    m = link[L_MASS]
    x, y, z = link[L_CENTRE], link[L_CENTRE + 1], link[L_CENTRE + 2]
    cx = w[_O] + w[_R] * x + w[_R + 1] * y + w[_R + 2] * z
    cy = w[_O + 1] + w[_R + 3] * x + w[_R + 4] * y + w[_R + 5] * z
    cz = w[_O + 2] + w[_R + 6] * x + w[_R + 7] * y + w[_R + 8] * z
    xx, yy, zz = link[L_INERTIA], link[L_INERTIA + 1], link[L_INERTIA + 2]
    xy, xz, yz = link[L_INERTIA + 3], link[L_INERTIA + 4], link[L_INERTIA + 5]
    at = _I
    for i in range(3):  # R I R^T, entries xx, yy, zz
        a, b, c = w[_R + 3 * i], w[_R + 3 * i + 1], w[_R + 3 * i + 2]
        w[at + i] = (
            a * a * xx + b * b * yy + c * c * zz + 2.0 * (a * b * xy + a * c * xz + b * c * yz)
        )
    for k in range(3):  # xy, xz, yz
        i, j = (0, 1) if k == 0 else (0, 2) if k == 1 else (1, 2)
        a, b, c = w[_R + 3 * i], w[_R + 3 * i + 1], w[_R + 3 * i + 2]
        d, e, f = w[_R + 3 * j], w[_R + 3 * j + 1], w[_R + 3 * j + 2]
        w[at + 3 + k] = (
            a * d * xx + b * e * yy + c * f * zz
            + (a * e + b * d) * xy + (a * f + c * d) * xz + (b * f + c * e) * yz
        )  # fmt: skip
    w[_M] = m
    w[_MC], w[_MC + 1], w[_MC + 2] = m * cx, m * cy, m * cz
    w[_I] += m * (cy * cy + cz * cz)
    w[_I + 1] += m * (cx * cx + cz * cz)
    w[_I + 2] += m * (cx * cx + cy * cy)
    w[_I + 3] -= m * cx * cy
    w[_I + 4] -= m * cx * cz
    w[_I + 5] -= m * cy * cz
    px, py, pz, lx, ly, lz = momentum(w, w[_W], w[_W + 1], w[_W + 2], w[_V], w[_V + 1], w[_V + 2])
    fx, fy, fz, nx, ny, nz = momentum(
        w, w[_DW], w[_DW + 1], w[_DW + 2], w[_DV], w[_DV + 1], w[_DV + 2]
    )
    ax, ay, az = cross(w[_W], w[_W + 1], w[_W + 2], px, py, pz)
    bx, by, bz = cross(w[_W], w[_W + 1], w[_W + 2], lx, ly, lz)
    cx, cy, cz = cross(w[_V], w[_V + 1], w[_V + 2], px, py, pz)
    w[_F], w[_F + 1], w[_F + 2] = fx + ax, fy + ay, fz + az
    w[_N], w[_N + 1], w[_N + 2] = nx + bx + cx, ny + by + cy, nz + bz + cz


def momentum(
    w: Any, wx: float, wy: float, wz: float, vx: float, vy: float, vz: float
) -> tuple[float, float, float, float, float, float]:
    """Spatial inertia in `w` times a spatial motion: linear part, then moment."""
    m, sx, sy, sz = w[_M], w[_MC], w[_MC + 1], w[_MC + 2]
    ax, ay, az = cross(wx, wy, wz, sx, sy, sz)
    bx, by, bz = cross(sx, sy, sz, vx, vy, vz)
    return (
        m * vx + ax,
        m * vy + ay,
        m * vz + az,
        w[_I] * wx + w[_I + 3] * wy + w[_I + 4] * wz + bx,
        w[_I + 3] * wx + w[_I + 1] * wy + w[_I + 5] * wz + by,
        w[_I + 4] * wx + w[_I + 5] * wy + w[_I + 2] * wz + bz,
    )


def mass_and_bias(
    links: Any, gravity: Any, angles: Any, speeds: Any, scratch: Any, mass: Any, bias: Any
) -> None:
    """Write the mass matrix and the bias torques of a tree of links.

    Parameters
    ----------
    links : (n, N_LINK_NUMBERS) array
        The numbers of each link (L_*); a parent comes before what it carries.
    gravity : (3,) array
        Acceleration of free fall in the base frame [m/s^2].
    angles, speeds : (n,) array
        Of the hinges [rad], [rad/s].
    scratch : (n, N_LINK_SCRATCH) array
        Memory for the computation.
    mass : (n, n) array
        Receives M [kg m^2].
    bias : (n,) array
        Receives h [N m].
    """
    n = len(links)
    for i in range(n):
        above = int(links[i][L_PARENT])
        on_base = above < 0
        parent = scratch[max(above, 0)]
        place_link(links[i], angles[i], scratch[i], parent, on_base)
        move_link(speeds[i], scratch[i], parent, on_base, gravity)
        load_link(links[i], scratch[i])
    for back in range(n):
        i = n - 1 - back
        w = scratch[i]
        zx, zy, zz = w[_R + 2], w[_R + 5], w[_R + 8]
        bias[i] = zx * w[_N] + zy * w[_N + 1] + zz * w[_N + 2]
        bias[i] += w[_S] * w[_F] + w[_S + 1] * w[_F + 1] + w[_S + 2] * w[_F + 2]
        px, py, pz, lx, ly, lz = momentum(w, zx, zy, zz, w[_S], w[_S + 1], w[_S + 2])
        for j in range(i):
            mass[i][j] = 0.0
            mass[j][i] = 0.0
        at = i
        while at >= 0:
            a = scratch[at]
            shared = a[_R + 2] * lx + a[_R + 5] * ly + a[_R + 8] * lz
            shared += a[_S] * px + a[_S + 1] * py + a[_S + 2] * pz
            mass[i][at] = shared
            mass[at][i] = shared
            at = int(links[at][L_PARENT])
        above = int(links[i][L_PARENT])
        if above >= 0:
            for k in range(_M, N_LINK_SCRATCH):
                scratch[above][k] += w[k]
