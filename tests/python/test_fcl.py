"""Depths from FCL: closed forms, what counts as a pair, refusals, and Bullet's own contact points beside them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from cairn import fcl, scenes
from cairn.bullet import BulletWorld
from cairn.scenes.model import Body, Box, Capsule, Joint, Plane, Scene, Sphere

pytest.importorskip("cairn._fcl", reason="cairn was built without FCL")

IDENTITY = (0.0, 0.0, 0.0, 1.0)
CUBE = Box((0.5, 0.5, 0.5))


def turned(angle: float, axis: int) -> tuple[float, ...]:
    q = [0.0, 0.0, 0.0, math.cos(angle / 2)]
    q[axis] = math.sin(angle / 2)
    return tuple(q)


def octahedron(radius: float) -> fcl.Convex:
    corners = [(radius, 0, 0), (-radius, 0, 0), (0, radius, 0), (0, -radius, 0), (0, 0, radius), (0, 0, -radius)]
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    return fcl.Convex(corners, faces)


def depth(*posed: tuple[fcl.AnyShape, tuple[float, ...], tuple[float, ...]]) -> float:
    poses = np.array([[*position, *orientation] for _, position, orientation in posed])
    return fcl.penetration([shape for shape, _, _ in posed], poses).worst


def test_closed_forms() -> None:
    floor = (Plane(), (0.0, 0.0, 0.0), IDENTITY)
    exact = 1e-12
    assert depth((Sphere(0.5), (0, 0, 0), IDENTITY), (Sphere(0.25), (0.3, 0.4, 0), IDENTITY)) == pytest.approx(
        0.25, abs=exact
    )
    assert depth(floor, (CUBE, (3, 0.4, 0), IDENTITY)) == pytest.approx(0.1, abs=exact)
    assert depth(floor, (CUBE, (3, 0.6, 0), turned(math.pi / 4, 2))) == pytest.approx(math.sqrt(0.5) - 0.6, abs=exact)
    # Capsules are about y: this one stands, that one lies.
    assert depth(floor, (Capsule(0.2, 0.5), (0, 0.6, 0), IDENTITY)) == pytest.approx(0.1, abs=exact)
    assert depth(floor, (Capsule(0.2, 0.5), (0, 0.15, 0), turned(math.pi / 2, 0))) == pytest.approx(0.05, abs=exact)
    assert depth((CUBE, (0, 0, 0), IDENTITY), (Capsule(0.2, 0.5), (0.69, 0, 0), IDENTITY)) == pytest.approx(
        0.01, abs=exact
    )
    assert depth((CUBE, (0, 0, 0), IDENTITY), (octahedron(0.4), (0, 0.85, 0), IDENTITY)) == pytest.approx(
        0.05, abs=exact
    )
    assert depth((CUBE, (0, 0, 0), IDENTITY), (CUBE, (2, 0, 0), IDENTITY)) == 0


def test_overlap_starts_a_quarter_deep() -> None:
    """Neighbours are 1 m long and 0.75 m apart; their feet touch the floor."""
    found = fcl.penetration(scenes.build("overlap"))
    assert found.overlapping == 9
    assert found.worst == pytest.approx(0.25)
    assert found.mean == pytest.approx(0.25)
    np.testing.assert_array_equal(found.pairs[found.distances < -0.1], [(i, i + 1) for i in range(1, 10)])


def test_worst_and_mean() -> None:
    ball = Sphere(0.5)
    poses = np.array([[x, 0, 0, *IDENTITY] for x in (0, 0.9, 1.6, 2.605)])
    found = fcl.penetration([ball] * 4, poses, margin=0.01)
    assert found.worst == pytest.approx(0.3)
    assert found.mean == pytest.approx(0.2)
    assert found.overlapping == 2
    np.testing.assert_array_equal(found.pairs, [(0, 1), (1, 2), (2, 3)])
    np.testing.assert_allclose(found.distances, [-0.1, -0.3, 0.005], atol=1e-12)
    apart = fcl.penetration([ball] * 2, poses[[0, 3]])
    assert (apart.worst, apart.mean, apart.overlapping, len(apart.pairs)) == (0, 0, 0, 0)


def test_pairs_that_cannot_touch_do_not_count() -> None:
    a, b = Body(CUBE, 1.0), Body(CUBE, 1.0, (0.9, 0, 0))

    def overlapping(first: Body, second: Body, *joints: Joint) -> int:
        return fcl.penetration(Scene("made", "", "", [first, second], list(joints))).overlapping

    assert overlapping(a, b) == 1
    assert overlapping(replace(a, mass=0.0), b) == 1
    assert overlapping(replace(a, mass=0.0), replace(b, mass=0.0)) == 0
    assert overlapping(replace(a, collision_group=1), replace(b, collision_group=1)) == 0
    assert overlapping(replace(a, collision_group=1), replace(b, collision_group=2)) == 1
    assert overlapping(replace(a, collision_group=-1), b) == 0
    assert overlapping(a, b, Joint("ball", 1, 0, (0.45, 0, 0))) == 0
    assert overlapping(a, b, Joint("ball", 1, None, (0.45, 0, 0))) == 1


def test_refusals_name_what_is_wrong() -> None:
    here = [[0.0, 0, 0, *IDENTITY]]
    with pytest.raises(ValueError, match=r"\[1, 7\]"):
        fcl.penetration([CUBE], here * 2)
    with pytest.raises(ValueError, match=r"poses\[0, 1\]"):
        fcl.penetration([CUBE], [[0, math.nan, 0, *IDENTITY]])
    with pytest.raises(ValueError, match=r"poses\[0\] has a quaternion of norm 2"):
        fcl.penetration([CUBE], [[0.0, 0, 0, 0, 0, 0, 2]])
    with pytest.raises(ValueError, match="margin"):
        fcl.penetration([CUBE], here, margin=-1)
    with pytest.raises(ValueError, match="shape 1: radius"):
        fcl.penetration([CUBE, Sphere(0.0)], here * 2)
    with pytest.raises(ValueError, match=r"shape 0: faces\[1\] names vertex 9"):
        fcl.penetration([fcl.Convex(octahedron(1).vertices, [(0, 2, 4), (2, 9, 4), (1, 3, 4), (3, 0, 4)])], here)
    inside_out = [tuple(reversed(face)) for face in octahedron(1).faces]
    with pytest.raises(ValueError, match=r"faces\[0\] is not a flat face"):
        fcl.penetration([fcl.Convex(octahedron(1).vertices, inside_out)], here)
    with pytest.raises(ValueError, match="poses"):
        fcl.penetration([CUBE])


@pytest.mark.parametrize("bits", [32, 64])
@pytest.mark.parametrize("name", ["stack", "stack-1m"])
def test_agrees_with_bullets_manifolds_where_boxes_lie_flat(name: str, bits: int) -> None:
    """Bullet keeps points of frames before; of boxes that lie flat on each other both say the same."""
    module = "cairn._bullet" if bits == 32 else "cairn._bullet64"  # cairn.bullet itself can always be imported
    pytest.importorskip(module, reason="cairn was built without Bullet")
    world = BulletWorld(scenes.build(name), "tjsoft", bullet_precision=bits)
    for _ in range(200):
        world.step()
    before = world.poses
    world.step()  # its contacts are those at the start of this step
    contacts = world.contacts
    found = fcl.penetration(world.scene, before, margin=0.01)
    deepest: dict[tuple[int, int], float] = {}
    for a, b, separation in zip(contacts["body_a"], contacts["body_b"], contacts["separation"]):
        pair = (int(min(a, b)), int(max(a, b)))
        deepest[pair] = min(deepest.get(pair, math.inf), float(separation))
    ours = {(int(a), int(b)): float(d) for (a, b), d in zip(found.pairs, found.distances)}
    layers = {pair for pair, separation in deepest.items() if separation < 0}
    assert len(layers) > 100
    box = world.scene.bodies[1].shape
    assert isinstance(box, Box)
    size = 2 * box.half_extents[0]
    for pair in layers:
        assert ours[pair] == pytest.approx(deepest[pair], abs=2e-3 * size), pair
    theirs = -min(deepest.values())
    assert found.worst == pytest.approx(theirs, abs=1e-3 * size)
    assert found.worst > 0
