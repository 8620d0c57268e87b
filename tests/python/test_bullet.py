"""The real Bullet through our binding: its own solvers give the figures known of them, and Cairn carries its scenes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cairn import metrics, scenes
from cairn.bullet import ALL_METHODS, BulletWorld
from cairn.scenes.model import Array, Body, Box, Capsule, Joint, Plane, Scene, Sphere, Wedge

_bullet = pytest.importorskip("cairn._bullet", reason="cairn was built without Bullet")
_bullet64 = pytest.importorskip("cairn._bullet64", reason="cairn was built without Bullet's double library")

FLOOR = Body(Plane(), 0.0, name="floor")


def made(*bodies: Body, joints: tuple[Joint, ...] = (), gravity: tuple[float, float, float] = (0, -9.81, 0)) -> Scene:
    return Scene("made", "", "", list(bodies), list(joints), gravity=gravity)


def run(world: BulletWorld, frames: int) -> tuple[float, float]:
    """(deepest contact, longest way of a body from its start) over the frames, m."""
    start = world.positions
    deepest = furthest = 0.0
    for _ in range(frames):
        world.step()
        deepest = max(deepest, metrics.penetration(world.contacts["separation"]))
        furthest = max(furthest, float(np.linalg.norm(world.positions - start, axis=1).max()))
    return deepest, furthest


# ---- Stock: figures measured elsewhere on the same library, with room for another compiler's rounding --------------


@pytest.mark.parametrize(("iterations", "nearest", "furthest"), [(10, 0.02, 0.15), (50, 0.01, 0.08)])
def test_stock_creeps(iterations: int, nearest: float, furthest: float) -> None:
    """125 boxes of a metre on a plane: 4 mm and 3 mm deep; in 3000 frames they creep by 18 and 11 cm, here in 600."""
    deepest, way = run(BulletWorld(scenes.build("stack-1m"), "stock", iterations=iterations), 600)
    assert 0.002 < deepest < 0.006
    assert nearest < way < furthest


def test_stock_with_substeps_stands() -> None:
    """10 substeps of 10 iterations: 0.04 mm deep, 15 mm from the start in 3000 frames."""
    deepest, way = run(BulletWorld(scenes.build("stack-1m"), "stock-substeps", iterations=100, substeps=10), 120)
    assert deepest < 0.0005
    assert way < 0.015


@pytest.mark.parametrize(("iterations", "substeps", "least", "most"), [(300, 1, 5.0, math.inf), (100, 10, 0.03, 0.15)])
def test_stock_chain_is_a_rubber_band_without_substeps(
    iterations: int, substeps: int, least: float, most: float
) -> None:
    """300 : 1 and 50 links: metres with one step of 300 iterations, 7 cm with 10 substeps of 10."""
    method = "stock" if substeps == 1 else "stock-substeps"
    chosen = None if substeps == 1 else substeps
    world = BulletWorld(scenes.build("chain-1m", radius=1.0), method, iterations=iterations, substeps=chosen)
    widest = 0.0
    for _ in range(600):
        world.step()
        widest = max(widest, float(world.joint_errors[:, 0].max()))
    assert least < widest < most


@pytest.mark.parametrize("method", ["nncg", "dantzig"])
def test_other_stock_solvers_carry_a_box(method: str) -> None:
    world = BulletWorld(made(FLOOR, Body(Box((0.5, 0.5, 0.5)), 1.0, (0, 0.5, 0))), method)
    for _ in range(60):
        world.step()
    assert world.positions[1, 1] == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("substeps", [2, 3, 7, 10, 30])
def test_stock_substeps_are_exactly_so_many(substeps: int) -> None:
    """Free fall tells how often was integrated: x = -g h^2 n (n + 1) / 2."""
    for frames in (1, 50):
        world = BulletWorld(made(Body(Sphere(0.5), 1.0)), "stock-substeps", iterations=10 * substeps, substeps=substeps)
        for _ in range(frames):
            world.step()
        n, h = frames * substeps, world.dt / substeps
        assert world.positions[0, 1] == pytest.approx(-9.81 * h * h * n * (n + 1) / 2, rel=1e-4)


# ---- Every method, one world ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ALL_METHODS)
@pytest.mark.parametrize("bits", [32, 64])
def test_a_box_rests_on_its_impulses(method: str, bits: int) -> None:
    box = Body(Box((0.5, 0.5, 0.5)), 2.0, (0, 0.5, 0))
    world = BulletWorld(made(FLOOR, box), method, bullet_precision=bits)
    for _ in range(120):
        world.step()
    contacts = world.contacts
    upwards = np.where(contacts["body_b"] == 1, 1.0, -1.0) * contacts["normal"][:, 1]
    np.testing.assert_allclose(upwards, 1, atol=1e-4)
    h = world.dt / (world.substeps if method == "stock-substeps" else 1)  # Bullet keeps the last internal step's
    assert contacts["impulse"].sum() == pytest.approx(2.0 * 9.81 * h, rel=0.01)
    assert world.positions[1] == pytest.approx((0, 0.5, 0), abs=0.01)
    assert 0 < world.solver_seconds <= world.step_seconds


@pytest.mark.parametrize("method", ["stock", "tj", "tjsoft"])
def test_joint_errors_agree_with_the_metrics(method: str) -> None:
    scene = scenes.build("joints")
    world = BulletWorld(scene, method)
    for _ in range(20):
        world.step()
    metres, radians = metrics.joint_errors(scene, world.positions, world.orientations)
    np.testing.assert_allclose(world.joint_errors[:, 0], metres, atol=1e-6)
    np.testing.assert_allclose(world.joint_errors[:, 1], radians, atol=1e-6)


@pytest.mark.parametrize("method", ["stock", "tjsoft"])
def test_motors_turn_b_relative_to_a(method: str) -> None:
    """The world is b, so body a goes the other way."""
    wheel = Body(Box((0.5, 0.5, 0.1)), 1.0)
    sled = Body(Box((0.5, 0.5, 0.5)), 1.0, (5, 0, 0))
    joints = (
        Joint("hinge", 0, None, (0, 0, 0), axis=(0, 0, 1), motor_speed=2.0, motor_force=100.0),
        Joint("slider", 1, None, (5, 0, 0), axis=(0, 1, 0), motor_speed=0.5, motor_force=math.inf),
    )
    world = BulletWorld(made(wheel, sled, joints=joints), method)
    for _ in range(30):
        world.step()
    assert world.velocities[0, 5] == pytest.approx(-2.0, abs=0.02)
    assert world.velocities[1, 1] == pytest.approx(-0.5, abs=0.02)


@pytest.mark.parametrize("method", ["stock", "tjsoft"])
def test_limits_hold(method: str) -> None:
    arm = Body(Box((0.5, 0.1, 0.1)), 1.0, (0.5, 0, 0))
    block = Body(Box((0.5, 0.5, 0.5)), 1.0, (5, 0, 0))
    joints = (
        Joint("hinge", 0, None, (0, 0, 0), axis=(0, 0, 1), lower=-0.4, upper=0.4),  # of the world relative to the arm
        Joint("slider", 1, None, (5, 0, 0), axis=(0, 1, 0), lower=-0.3, upper=0.3),
    )
    world = BulletWorld(made(arm, block, joints=joints), method, iterations=100)
    for _ in range(200):
        world.step()
    x, y = world.positions[0, :2]
    assert math.atan2(y, x) == pytest.approx(-0.4, abs=0.03)
    assert world.positions[1, 1] == pytest.approx(-0.3, abs=0.03)


@pytest.mark.parametrize("solver", ["pgs", "cairn"])
def test_six_dof_axes(solver: str) -> None:
    world = _bullet.World((0, 0, 0), solver)
    first = world.add_box((0.5, 0.5, 0.5), mass=0)
    second = world.add_box((0.5, 0.5, 0.5), mass=1, position=(2, 0, 0))
    free, held = (1.0, -1.0), (0.0, 0.0)
    limits = [free, held, held, held, held, free]
    lower, upper = zip(*limits)
    speed, force = (0.5, 0, 0, 0, 0, 0.7), (100, 0, 0, 0, 0, 100)
    axes = np.eye(3).reshape(-1).tolist()
    world.add_six_dof(first, second, (2, 0, 0), axes, lower, upper, motor_speed=speed, motor_force=force)
    for _ in range(60):
        world.step(1 / 60)
    np.testing.assert_allclose(world.velocities()[second], (0.5, 0, 0, 0, 0, 0.7), atol=0.02)
    assert world.poses()[second, 0] == pytest.approx(2.5, abs=0.02)
    assert world.joint_errors().max() < 0.01


def test_groups_do_not_collide() -> None:
    def height(group: int, floor_group: int) -> float:
        floor, box = replace(FLOOR, collision_group=floor_group), Body(Box((0.5, 0.5, 0.5)), 1.0, (0, 0.5, 0))
        world = BulletWorld(made(floor, replace(box, collision_group=group)), "stock")
        for _ in range(60):
            world.step()
        return float(world.positions[1, 1])

    assert height(0, 0) == height(1, 2) == pytest.approx(0.5, abs=0.01)
    assert height(1, 1) < -1  # falls through
    assert height(-1, 0) < -1


def test_capsules_lie_on_their_side() -> None:
    lying = Body(Capsule(0.2, 0.5), 1.0, (0, 0.25, 0), orientation=(math.sqrt(0.5), 0, 0, math.sqrt(0.5)))
    for method in ("stock", "tjsoft"):
        world = BulletWorld(made(FLOOR, lying), method)
        for _ in range(60):
            world.step()
        assert world.positions[1, 1] == pytest.approx(0.2, abs=0.01)


@pytest.mark.parametrize("method", ["tjsoft", "stock"])
def test_a_force_pushes_in_every_substep(method: str) -> None:
    """On its own, beside gravity; a body without one falls as before."""
    pushed = Body(Sphere(0.1), 2.0, (0, 0, 0), force=(3.0, 0.0, -1.0))
    world = BulletWorld(Scene("push", "", "", [pushed, Body(Sphere(0.1), 2.0, (9, 0, 0))], dt=0.01), method)
    for _ in range(10):
        world.step()
    np.testing.assert_allclose(world.velocities[:, :3], [[0.15, -0.981, -0.05], [0, -0.981, 0]], rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("method", ["tjsoft", "stock"])
def test_a_removed_body_carries_nothing(method: str) -> None:
    bodies = [Body(Plane(), 0.0), Body(Box((0.5, 0.5, 0.5)), 1.0, (0, 0.5, 0)), Body(Sphere(0.5), 1.0, (0, 1.5, 0))]
    joint = Joint("ball", 1, None, (0, 0.5, 0))
    world = BulletWorld(Scene("removal", "", "", [*bodies, Body(Sphere(0.1), 1.0, (5, 5, 5))], [joint]), method)
    for _ in range(20):
        world.step()
    assert set(world.contacts["body_a"]) | set(world.contacts["body_b"]) >= {2}
    with pytest.raises(ValueError, match="body 1 is held by a joint"):
        world.remove(1)
    world.remove(2)
    with pytest.raises(ValueError, match="body 2 was removed before"):
        world.remove(2)
    last = world.poses[2]
    for _ in range(5):
        world.step()
    np.testing.assert_array_equal(world.poses[2], last)
    assert not {2} & (set(world.contacts["body_a"]) | set(world.contacts["body_b"]))


def test_a_joint_may_start_with_an_error() -> None:
    """Its two anchors are then as far apart as they were given, in Bullet and in the metrics."""
    body = Body(Sphere(0.1), 1.0, (1.0, 0, 0), collision_group=-1)
    joint = Joint("ball", 0, None, (0.75, 0, 0), anchor_b=(0.5, 0, 0))
    scene = Scene("apart", "", "", [body], [joint], gravity=(0.0, 0.0, 0.0))
    world = BulletWorld(scene, "tjsoft")
    assert world.joint_errors[0, 0] == pytest.approx(0.25)
    assert metrics.joint_errors(scene, world.positions, world.orientations)[0] == pytest.approx([0.25])
    for _ in range(200):
        world.step()
    assert world.joint_errors[0, 0] == pytest.approx(0, abs=1e-4)
    assert world.positions[0] == pytest.approx([0.75, 0, 0], abs=1e-3)


def test_a_wedge_stands_on_its_lower_face() -> None:
    wedge = Wedge(0.5, 0.3, 0.6, 0.4)
    scene = Scene("wedge", "", "", [Body(Plane(), 0.0), Body(wedge, 1.0, (0, wedge.centre_height, 0))])
    world = BulletWorld(scene, "tjsoft")
    for _ in range(120):
        world.step()
    assert world.positions[1] == pytest.approx([0, wedge.centre_height, 0], abs=2e-3)
    assert abs(world.orientations[1, 3]) == pytest.approx(1, abs=1e-5)
    with pytest.raises(ValueError, match="at least 4 points, not 3"):
        world._world.add_hull([(0, 0, 0), (1, 0, 0), (0, 1, 0)], mass=1.0)


def test_both_precisions_agree_while_they_can() -> None:
    scene = scenes.build("stack-1m", columns=2, rows=1, layers=2)
    ends: list[Array] = []
    for bits in (32, 64):
        world = BulletWorld(scene, "tjsoft", bullet_precision=bits)
        for _ in range(30):
            world.step()
        ends.append(world.positions)
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-3)
    assert (_bullet.PRECISION, _bullet64.PRECISION) == (32, 64)
    assert not np.array_equal(ends[0], ends[1])


@pytest.mark.parametrize(
    ("home", "far", "sizes", "frames", "bits", "apart"),
    [
        # The joints know the origin only through Bullet's own digits.
        ("chain", "far-chain", {"links": 10}, 20, 64, 1e-6),
        ("chain", "far-chain", {"links": 10}, 20, 32, 5e-3),  # a float's are 1 mm apart there
        # A box's first point on a plane is one of four corners alike, which rounding chooses.
        ("stack", "far", {"columns": 3, "layers": 3, "rows": 3}, 40, 64, 2e-3),
        ("stack", "far", {"columns": 3, "layers": 3, "rows": 3}, 40, 32, 5e-3),
    ],
)
def test_ten_kilometres_away_all_is_as_at_home(
    home: str, far: str, sizes: dict[str, float], frames: int, bits: int, apart: float
) -> None:
    scene = [scenes.build(home, **sizes), scenes.build(far, kilometres=10, **sizes)]
    here, there = (BulletWorld(s, "tjsoft", iterations=40, substeps=4, threads=1, bullet_precision=bits) for s in scene)
    moves = scene[0].masses > 0
    for _ in range(frames):
        here.step()
        there.step()
        difference = (there.positions - here.positions)[moves] - [10_000, 0, 0]
        assert np.abs(difference).max() < apart


def test_threads_and_instructions_change_nothing() -> None:
    ends: list[Array] = []
    for threads, instructions in ((1, "scalar"), (2, "auto")):
        world = BulletWorld(scenes.build("stack"), "tjsoft", threads=threads, instructions=instructions)
        for _ in range(20):
            world.step()
        ends.append(world.poses)
    np.testing.assert_array_equal(ends[0], ends[1])


# ---- What is asked and what is refused -----------------------------------------------------------------------------


def test_cairn_tells_what_it_did() -> None:
    world = BulletWorld(
        scenes.build("stack-1m", columns=1, rows=1), "tj", iterations=40, substeps=4, params={"residual_trace": 1}
    )
    for _ in range(5):
        world.step()
    statistics = world.statistics
    assert statistics["bodies"] == 5
    assert statistics["contacts"] == len(world.contacts["separation"])
    assert statistics["warm_started"] > 0
    assert statistics["iterations"] == 40
    assert len(world.residual_trace) == 40
    assert world.params["substeps"] == 4


def test_params_come_as_a_dict_or_as_the_structs_bytes() -> None:
    world = _bullet.World(solver="cairn", params={"method": 3, "iterations": 33, "substeps": 3})
    assert world.params["method"] == 3
    assert world.params["iterations"] == 33
    with pytest.raises(ValueError, match="no field 'iteration'"):
        world.params = {"iteration": 3}
    with pytest.raises(ValueError, match="iterations"):
        world.params = {"iterations": 0}
    with pytest.raises(ValueError, match="bytes here, not 3"):
        world.params = b"abc"
    assert world.params["iterations"] == 33


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"method": "pgs"}, "no method is called 'pgs'"),
        ({"method": "stock", "substeps": 4}, "'stock-substeps' has"),
        ({"method": "stock-substeps", "substeps": 1}, "at least 2"),
        ({"method": "stock-substeps", "substeps": 10, "iterations": 5}, "cannot be shared out"),
        ({"method": "stock", "params": {"splitting": "point"}}, "Bullet's own solver"),
        ({"method": "tj", "params": {"split": "point"}}, "no parameter is called 'split'"),
        ({"method": "tj", "bullet_precision": 16}, "32 and with 64"),
        ({"method": "tj", "instructions": "mmx"}, "'mmx' are unknown"),
    ],
)
def test_bad_requests_are_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        BulletWorld(made(FLOOR), **arguments)


def test_bad_worlds_are_refused() -> None:
    world = _bullet.World()
    box = world.add_box((1, 1, 1), mass=1)
    axes = np.eye(3).reshape(-1).tolist()
    with pytest.raises(ValueError, match="no solver 'psg'"):
        _bullet.World(solver="psg")
    with pytest.raises(IndexError, match="no body 7"):
        world.add_joint("ball", box, 7, (0, 0, 0), axes)
    with pytest.raises(ValueError, match="twice"):
        world.add_joint("ball", box, box, (0, 0, 0), axes)
    with pytest.raises(ValueError, match="no joint 'weld'"):
        world.add_joint("weld", box, -1, (0, 0, 0), axes)
    with pytest.raises(ValueError, match="its mass must be 0"):
        world.add_plane((0, 1, 0), 0, mass=1)
    with pytest.raises(ValueError, match="dt must be"):
        world.step(0)
    with pytest.raises(RuntimeError, match="stock solver"):
        world.statistics()
    with pytest.raises(ValueError, match="iterations must be"):
        world.iterations = 0


def test_a_refused_step_raises_and_moves_nothing_by_constraints() -> None:
    from cairn import Error

    world = BulletWorld(made(FLOOR, Body(Box((0.5, 0.5, 0.5)), 1.0, (0, 0.5, 0))), "tjsoft")
    world.set_velocity(1, (math.nan, 0, 0))
    with pytest.raises(Error, match="linear_velocity"):
        world.step()
