"""The metrics on data whose answers are known."""

from __future__ import annotations

import hashlib
import math

import numpy as np
import pytest

from cairn import metrics
from cairn.scenes.model import Body, Box, Joint, Scene

DOWN = (0.0, -10.0, 0.0)
QUARTER_Z = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))  # a quarter turn about z


def test_rotation_matrices() -> None:
    quarter = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    np.testing.assert_allclose(metrics.rotation_matrices(np.array([QUARTER_Z])), [quarter], atol=1e-15)
    # Rodrigues' formula about an axis in no special direction.
    axis, angle = np.array([2.0, -3.0, 6.0]) / 7, 0.7
    q = np.array([*(math.sin(angle / 2) * axis), math.cos(angle / 2)])
    cross = np.cross(np.eye(3), axis)
    expected = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    np.testing.assert_allclose(metrics.rotation_matrices(q), expected, atol=1e-15)


def test_kinetic_energy_turns_the_inertia_with_the_body() -> None:
    masses, inertias = np.array([2.0, 0.0]), np.array([[1.0, 5.0, 9.0], [0.0, 0.0, 0.0]])
    orientations = np.array([QUARTER_Z, (0, 0, 0, 1)])
    linear, angular = np.array([[3.0, 0, 4], [7, 7, 7]]), np.array([[2.0, 0, 0], [7, 7, 7]])
    # World x is the body's -y: inertia 5.
    assert metrics.kinetic_energy(masses, inertias, orientations, linear, angular) == pytest.approx(25 + 10)


def test_potential_energy() -> None:
    assert metrics.potential_energy(np.array([2.0, 0.0]), np.array([[9.0, 3, 9], [0, 50, 0]]), DOWN) == 60


def test_penetration() -> None:
    assert metrics.penetration([0.1, -0.02, -0.005]) == 0.02
    assert metrics.penetration([0.1]) == 0
    assert metrics.penetration([]) == 0


def test_drift_and_settling_are_horizontal_and_vertical() -> None:
    place = np.array([[0.0, 1, 0], [5, 1, 0]])
    track = place + np.array([[[0.0, -9, 0]], [[3, 7, 4]], [[1, 0, 0]]])
    assert metrics.drift(track, place, DOWN) == pytest.approx(5)
    assert metrics.settling(place + np.array([(3, 0.25, 4), (0, 0.5, 0)]), place, DOWN) == pytest.approx(0.5)
    tilted = (0.0, -6.0, -8.0)  # up is (0, 0.6, 0.8)
    along = np.array([[(0.0, 0.6, 0.8)]])
    assert metrics.drift(place[:1] + along, place[:1], tilted) == pytest.approx(0, abs=1e-12)
    assert metrics.drift(place[:1] + along, place[:1], (0, 0, 0)) == pytest.approx(1)  # no up: all directions count


def test_collapse() -> None:
    place, reach = np.zeros((2, 3)), np.array([0.5, np.inf])
    track = np.zeros((4, 2, 3))
    track[:, 1] = 100  # reaches for ever: cannot move
    assert metrics.collapsed_at(track, place, reach) is None
    track[2:, 0, 1] = -0.51
    assert metrics.collapsed_at(track, place, reach) == 2


def test_speeds() -> None:
    positions = np.array([[0.0, 0, 0], [0, 0, 2], [0, 5, 2]])
    velocities = np.array([[0.0, 0, -1], [3, 0, 0.5], [0, -4, 0]])
    assert metrics.max_speed(velocities) == 4
    assert metrics.separation_speed(positions, velocities, [(0, 1)]) == 1.5  # sideways motion does not count
    assert metrics.separation_speed(positions, velocities, [(1, 2)]) == 0  # they approach
    assert metrics.separation_speed(positions, velocities, [(0, 1), (1, 2)]) == 1.5
    assert metrics.separation_speed(positions, velocities, []) == 0


def test_finite() -> None:
    assert metrics.finite(np.zeros(3), 1.0)
    assert not metrics.finite(np.zeros(3), np.array([1.0, np.nan]))
    assert not metrics.finite(np.inf)


def test_state_hash() -> None:
    p, q, v, w = np.ones((1, 3)), np.ones((1, 4)), np.zeros((1, 3)), np.zeros((1, 3))
    assert metrics.state_hash(p, q, v, w) == hashlib.sha256(b"\0\0\x80\x3f" * 7 + bytes(24)).hexdigest()
    assert metrics.state_hash(p, q, v, w + 1e-30) != metrics.state_hash(p, q, v, w)


def joined(kind: str, axis: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> metrics.JointErrors:
    """Two bodies a metre apart, the second turned a quarter, joined half way; and the first to the world."""
    box = Box((0.1, 0.1, 0.1))
    bodies = [Body(box, 1, (0, 0, 0)), Body(box, 1, (1, 0, 0), QUARTER_Z)]
    anchor = (0.5, 0.0, 0.0)
    return metrics.JointErrors(
        Scene("", "", "", bodies, [Joint(kind, 0, 1, anchor, axis), Joint(kind, 0, None, anchor, axis)])
    )


START = np.array([[0.0, 0, 0], [1, 0, 0]]), np.array([(0.0, 0, 0, 1), QUARTER_Z])


def turned(axis: tuple[float, float, float], angle: float) -> tuple[float, float, float, float]:
    """The second body's orientation, turned further about a world axis."""
    x, y, z = (math.sin(angle / 2) * c for c in axis)
    w = math.cos(angle / 2)
    _, _, s, c = QUARTER_Z
    return (x * c + y * s, y * c - x * s, w * s + z * c, w * c - z * s)


@pytest.mark.parametrize("kind", ["ball", "hinge", "slider", "fixed"])
def test_joints_fit_at_the_start(kind: str) -> None:
    metres, radians = joined(kind)(*START)
    np.testing.assert_allclose(metres, 0, atol=1e-15)
    np.testing.assert_allclose(radians, 0, atol=1e-15)


@pytest.mark.parametrize("kind", ["ball", "hinge", "fixed"])
def test_gap_of_the_anchors(kind: str) -> None:
    positions = START[0].copy()
    positions[1] += (0.03, 0, 0.04)
    metres, radians = joined(kind)(positions, START[1])
    np.testing.assert_allclose(metres, [0.05, 0], atol=1e-12)
    np.testing.assert_allclose(radians, 0, atol=1e-12)


def test_slider_is_free_along_its_axis_only() -> None:
    positions = START[0].copy()
    positions[1] += (3.0, 0, 0.04)
    metres, _ = joined("slider", axis=(1, 0, 0))(positions, START[1])
    np.testing.assert_allclose(metres, [0.04, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("kind", "axis", "error"),
    [
        ("ball", (0.0, 1.0, 0.0), 0.0),
        ("hinge", (0.0, 0.0, 1.0), 0.0),  # its own axis
        ("hinge", (0.0, 1.0, 0.0), 0.2),
        ("slider", (0.0, 0.0, 1.0), 0.2),
        ("fixed", (0.0, 0.0, 1.0), 0.2),
        ("fixed", (1.0, 0.0, 0.0), 0.2),
    ],
)
def test_turned_joints(kind: str, axis: tuple[float, float, float], error: float) -> None:
    positions, orientations = START[0].copy(), START[1].copy()
    orientations[1] = turned(axis, 0.2)
    # Turned about the anchor, so that it stays where it is.
    arm = positions[1] - (0.5, 0, 0)
    about = np.asarray(axis)
    rotated = arm * math.cos(0.2) + np.cross(about, arm) * math.sin(0.2) + about * (about @ arm) * (1 - math.cos(0.2))
    positions[1] = np.array([0.5, 0, 0]) + rotated
    metres, radians = joined(kind)(positions, orientations)
    np.testing.assert_allclose(radians, [error, 0], atol=1e-12)
    np.testing.assert_allclose(metres, 0, atol=1e-12)


def test_errors_of_large_turns_are_the_angle() -> None:
    orientations = START[1].copy()
    orientations[1] = turned((0, 1, 0), 2.5)
    for kind in ("hinge", "fixed"):
        assert joined(kind)(START[0], orientations)[1][0] == pytest.approx(2.5)
