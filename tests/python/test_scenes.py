"""The scenes' numbers, as the paper's experiments need them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cairn import scenes
from cairn.scenes.model import Body, Box, Capsule, Joint, Plane, Sphere
from cairn.summary import KEYS

PAPER = ("stack", "stack-1m", "chain", "chain-1m", "overlap", "joints", "crank")


@pytest.mark.parametrize("name", scenes.SCENES)
def test_every_scene(name: str) -> None:
    scene = scenes.build(name)
    assert (scene.name, scene.dt) == (name, 0.016)
    if name in PAPER:
        assert (scene.frames, scene.gravity) == (3000, (0.0, -9.81, 0.0))
    assert scene.failure in KEYS or scene.failure in scene.quantities
    start = {key: value(scene.start_positions, scene.start_orientations) for key, value in scene.quantities.items()}
    assert all(abs(value) < 1e-12 for value in start.values())  # nothing has failed yet
    assert scene.why.endswith((".", "?"))
    assert scene.settings == scenes.settings_of(name)
    assert len({body.name for body in scene.bodies}) == len(scene.bodies)
    for joint in scene.joints:
        frame = joint.frame_at_start()
        np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-12)
        assert np.linalg.det(frame) == pytest.approx(1)
        assert joint.body_a != joint.body_b


def test_stack() -> None:
    scene = scenes.build("stack")
    boxes = scene.bodies[1:]
    assert len(boxes) == 125
    assert all(box.shape == Box((0.1, 0.1, 0.1)) and box.mass == pytest.approx(0.8) for box in boxes)
    # A contact's friction is the product of its bodies'.
    assert scene.bodies[0].friction * boxes[0].friction == pytest.approx(0.5)
    heights = np.unique(np.round(scene.start_positions[1:, 1], 9))
    np.testing.assert_allclose(heights, 0.101 + 0.201 * np.arange(5))
    assert heights[-1] - 0.9 == pytest.approx(0.005)  # how far the top settles
    np.testing.assert_allclose(np.unique(np.round(scene.start_positions[1:, 0], 9)), [-0.4, -0.2, 0, 0.2, 0.4])


def test_stack_1m() -> None:
    scene = scenes.build("stack-1m")
    assert {box.shape for box in scene.bodies[1:]} == {Box((0.5, 0.5, 0.5))}
    assert set(scene.masses[1:]) == {1.0}
    assert {body.friction for body in scene.bodies} == {0.5}
    np.testing.assert_allclose(np.unique(scene.start_positions[1:, 1]), [0.5, 1.5, 2.5, 3.5, 4.5])


def test_stack_grows() -> None:
    assert len(scenes.build("stack", layers=7, columns=2, rows=1).bodies) == 1 + 14


@pytest.mark.parametrize(
    ("name", "half", "mass", "spacing", "radius"),
    [("chain", (0.025, 0.045, 0.01), 0.009, 0.1, 1.25), ("chain-1m", (0.4, 0.2, 0.2), 1.0, 1.0, 2.0)],
)
def test_chains(name: str, half: tuple[float, float, float], mass: float, spacing: float, radius: float) -> None:
    scene = scenes.build(name)
    *links, ball = scene.bodies
    assert len(links) == 50
    assert all(isinstance(link.shape, Box) and link.shape.half_extents == pytest.approx(half) for link in links)
    np.testing.assert_allclose(scene.masses[:-1], mass)
    np.testing.assert_allclose(scene.start_positions[:-1, 0], spacing * (np.arange(50) + 0.5))
    assert ball.shape == Sphere(radius)
    assert ball.mass == pytest.approx(300 * mass)
    assert ball.position == pytest.approx((50 * spacing + radius, 0, 0))
    assert len(scene.joints) == 51
    assert {joint.kind for joint in scene.joints} == {"hinge"}
    assert [joint.body_b for joint in scene.joints[:2]] == [None, 0]
    np.testing.assert_allclose([joint.anchor[0] for joint in scene.joints], spacing * np.arange(51), atol=1e-12)
    assert len({body.collision_group for body in scene.bodies} - {0}) == 1


def test_overlap() -> None:
    scene = scenes.build("overlap")
    assert len(scene.bodies) == 11
    np.testing.assert_allclose(scene.masses[1:], 42.25)
    z = scene.start_positions[1:, 2]
    np.testing.assert_allclose(1.0 - np.diff(z), 0.25)  # by how much neighbours overlap
    np.testing.assert_allclose(scene.start_positions[1:, 1], 0.325)  # on the plane
    assert scene.neighbours == [(i, i + 1) for i in range(1, 10)]


def test_joints_has_one_pair_of_each_kind() -> None:
    scene = scenes.build("joints")
    assert [joint.kind for joint in scene.joints] == ["ball", "hinge", "slider", "fixed"]
    assert [(joint.body_a, joint.body_b) for joint in scene.joints] == [(0, 1), (2, 3), (4, 5), (6, 7)]
    # The anchor is a point of the moving body that stands still at the start, except along a slider's axis.
    for joint in scene.joints:
        assert joint.body_b is not None
        body = scene.bodies[joint.body_b]
        arm = np.subtract(joint.anchor, body.position)
        velocity = np.add(body.linear_velocity, np.cross(body.angular_velocity, arm))
        if joint.kind == "slider":
            velocity = velocity - np.dot(velocity, joint.axis) * np.array(joint.axis)
        np.testing.assert_allclose(velocity, 0, atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.5, math.pi, 5.0])
def test_crank_formula(angle: float) -> None:
    """The rod's ends, placed by the formula, are a rod's length apart."""
    scene = scenes.build("crank")
    r, rod = scene.settings["crank_length"], scene.settings["rod_length"]
    piston = np.array([scenes.piston_position(angle, r, rod), 0, 0])
    pin = r * np.array([math.cos(angle), math.sin(angle), 0])
    assert np.linalg.norm(piston - pin) == pytest.approx(rod)
    positions, orientations = scene.start_positions, scene.start_orientations
    positions[2] = np.array([0.003, 0, 0.004]) + piston
    orientations[0] = (0, 0, math.sin(angle / 2), math.cos(angle / 2))
    assert scene.quantities["piston_error_m"](positions, orientations) == pytest.approx(0.005)


def touching(scene: scenes.Scene) -> float:
    """m, how deep the boxes and balls of a scene, taken as boxes, overlap each other and the floor; negative: a gap."""
    solid = [body for body in scene.bodies if isinstance(body.shape, (Box, Sphere))]
    low = np.array([np.subtract(body.position, reach(body)) for body in solid])
    high = np.array([np.add(body.position, reach(body)) for body in solid])
    deepest = -float(low[:, 1].min())
    for i in range(len(solid)):
        overlap = np.minimum(high[i], high[i + 1 :]) - np.maximum(low[i], low[i + 1 :])
        deepest = max(deepest, float(overlap.min(axis=1).max(initial=-math.inf)))
    return deepest


def reach(body: Body) -> tuple[float, float, float]:
    if isinstance(body.shape, Sphere):
        return (body.shape.radius,) * 3
    assert isinstance(body.shape, Box)
    return body.shape.half_extents


@pytest.mark.parametrize("name", ["column", "pyramid", "mass-ratio", "inverted", "hub"])
def test_heaps_touch_at_the_start(name: str) -> None:
    small = {"hub": {"balls": 4}, "pyramid": {"base": 6}}.get(name, {})
    assert touching(scenes.build(name, **small)) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("name", ["bounce", "666"])
def test_what_falls_starts_apart(name: str) -> None:
    assert touching(scenes.build(name)) < -0.02


def test_sizes_of_the_heaps() -> None:
    assert len(scenes.build("column", boxes=40).bodies) == 41
    assert len(scenes.build("pyramid", base=100).bodies) == 5051
    heavy, light = scenes.build("mass-ratio", ratio=300).masses[[2, 1]]
    assert heavy == 300 * light
    weights = scenes.build("inverted").masses[1:]
    np.testing.assert_allclose(weights[1:] / weights[:-1], 8)
    assert weights[1:].sum() / weights[0] == pytest.approx(8 + 64 + 512 + 4096)
    hub = scenes.build("hub")
    assert len(hub.bodies) == 1 + 576 + 1
    pile = scenes.build("pile", bodies=90)
    shapes = [type(body.shape) for body in pile.bodies if not isinstance(body.shape, Plane)]
    assert [shapes.count(kind) for kind in (Box, Sphere, Capsule)] == [30, 30, 30]
    for body in pile.bodies:  # inside the well, by its planes
        for wall in pile.bodies[:5]:
            assert isinstance(wall.shape, Plane)
            if body.mass > 0:
                assert np.dot(wall.shape.normal, body.position) - wall.shape.offset > 0.4 * 0.25


def test_joint_grid_is_a_net() -> None:
    scene = scenes.build("joint-grid", columns=5, rows=4)
    assert len(scene.joints) == 4 * 4 + 3 * 5
    assert [i for i, body in enumerate(scene.bodies) if body.mass == 0] == [0, 4]
    for joint in scene.joints:
        assert joint.body_b is not None
        ends = scene.start_positions[[joint.body_a, joint.body_b]]
        np.testing.assert_allclose(ends.mean(axis=0), joint.anchor)
        assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(0.1)
    lower = scene.start_positions - [0, 0.7, 0]
    assert scene.quantities["sag_m"](lower, scene.start_orientations) == pytest.approx(0.7)


def test_slope_sticks_above_its_tangent() -> None:
    scene = scenes.build("slope", slabs=6)
    moved = scene.start_positions
    moved[1:4] += 5.0  # friction 0, 0.2, 0.4: below tan 30 degrees
    assert scene.quantities["creep_m"](moved, scene.start_orientations) == 0
    moved[4] += [0.03, 0, 0.04]  # 0.6
    assert scene.quantities["creep_m"](moved, scene.start_orientations) == pytest.approx(0.05)
    with pytest.raises(ValueError, match="degrees = 95"):
        scenes.build("slope", degrees=95)


def test_tumble_spins_about_the_middle_axis() -> None:
    (box,) = scenes.build("tumble").bodies
    least, greatest, middle = box.inertia
    assert least < middle < greatest
    assert np.argmax(np.abs(box.angular_velocity)) == 2


def test_windmill() -> None:
    scene = scenes.build("windmill")
    assert scene.masses[2:7].sum() == pytest.approx(100)
    blocks = [body for body in scene.bodies if body.name.startswith("block")]
    assert len(blocks) == 75
    blade = scene.bodies[3]
    assert blade.position[0] + 1 > min(block.position[0] for block in blocks) > 1  # the blades reach into the stack


def test_what_build_refuses() -> None:
    with pytest.raises(ValueError, match="no scene is called 'stak'; there are stack, stack-1m"):
        scenes.build("stak")
    with pytest.raises(ValueError, match="scene 'chain' has no setting 'layers'; it has links, spacing"):
        scenes.build("chain", layers=3)
    with pytest.raises(ValueError, match=r"layers counts things, so 2\.5 must be a whole number"):
        scenes.build("stack", layers=2.5)
    with pytest.raises(ValueError, match="links = 0 must be at least 1"):
        scenes.build("chain", links=0)
    with pytest.raises(ValueError, match="rod_length"):
        scenes.build("crank", rod_length=0.1)


def test_inertia() -> None:
    assert Body(Box((1, 2, 3)), 6).inertia == (2 * 13, 2 * 10, 2 * 5)
    assert Body(Sphere(2), 5).inertia == (8, 8, 8)
    # A capsule without a cylinder is a sphere; one with a very long cylinder is a rod.
    assert Body(Capsule(2, 0), 5).inertia == pytest.approx((8, 8, 8))
    across, along, _ = Body(Capsule(0.001, 1), 3).inertia
    assert across == pytest.approx(1, rel=1e-2)
    assert along == pytest.approx(0.5 * 3 * 1e-6, rel=1e-2)


def test_capsule_inertia_by_integration() -> None:
    """Against a sum over thin discs across the capsule's axis."""
    radius, half, mass = 0.5, 0.7, 2.0
    y = np.linspace(-half - radius, half + radius, 20001)
    reach = np.clip(np.abs(y) - half, 0, None)
    disc = np.clip(radius**2 - reach**2, 0, None)  # squared radius of the disc at y
    weight = mass * disc / disc.sum()
    across, along, _ = Body(Capsule(radius, half), mass).inertia
    assert along == pytest.approx(np.sum(weight * disc / 2), rel=1e-4)
    assert across == pytest.approx(np.sum(weight * (disc / 4 + y * y)), rel=1e-4)


def test_joint_axes_of_the_frame() -> None:
    axis = (0.6, 0.0, 0.8)
    np.testing.assert_allclose(Joint("hinge", 0, None, (0, 0, 0), axis).frame_at_start()[:, 2], axis)
    np.testing.assert_allclose(Joint("slider", 0, None, (0, 0, 0), axis).frame_at_start()[:, 0], axis)
