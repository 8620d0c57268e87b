"""The scenes' numbers, as the paper's experiments need them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cairn import scenes
from cairn.metrics import joint_errors
from cairn.scenes.model import Body, Box, Capsule, Joint, Plane, Sphere, Wedge
from cairn.scenes.motion import rolling_accelerations
from cairn.summary import KEYS

PAPER = ("stack", "stack-1m", "chain", "chain-1m", "overlap", "joints", "crank")


@pytest.mark.parametrize("name", scenes.SCENES)
def test_every_scene(name: str) -> None:
    scene = scenes.build(name)
    assert (scene.name, scene.dt) == (name, 0.01 if name == "kapla" else 0.016)
    if name in PAPER:
        assert (scene.frames, scene.gravity) == (3000, (0.0, -9.81, 0.0))
    assert scene.failure in (*KEYS, *scene.quantities, *scene.motions)
    if scene.tolerance is not None:
        assert 0 < scene.tolerance[0] < scene.tolerance[1]
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


def test_jeep_bridge() -> None:
    scene = scenes.build("jeep-bridge")
    kinds = [joint.kind for joint in scene.joints]
    assert (kinds.count("fixed"), kinds.count("hinge")) == (42 + 2, 2 + 4)
    assert [joint.kind for joint in scenes.build("jeep-bridge", hinged=1).joints].count("hinge") == 44 + 4
    planks = [body for body in scene.bodies if body.name.startswith("plank")]
    np.testing.assert_allclose(np.diff([plank.position[2] for plank in planks]), 0.911)
    assert len(planks) == 43 and {plank.mass for plank in planks} == {80.0}
    named = {body.name: body for body in scene.bodies}
    jeep, chassis = named["jeep"], named["chassis"]
    assert jeep.mass + chassis.mass == pytest.approx(1548)
    centre = (jeep.mass * jeep.position[1] + chassis.mass * chassis.position[1]) / 1548
    assert jeep.position[1] - centre == pytest.approx(1)
    wheels = [body for name, body in named.items() if name.startswith("wheel")]
    assert len(wheels) == 4 and sum(wheel.mass for wheel in wheels) == 4 * 56
    assert {round(abs(wheel.position[0]), 9) for wheel in wheels} == {0.812}
    assert wheels[0].position[2] - wheels[2].position[2] == pytest.approx(3.147)
    assert wheels[0].position[1] - 0.447 == pytest.approx(planks[0].position[1] + 0.142)  # on the road
    moved = scene.start_positions
    moved[[4, scene.bodies.index(jeep)]] += [0, -0.02, 3.0]
    quantities = {name: value(moved, scene.start_orientations) for name, value in scene.quantities.items()}
    assert quantities == pytest.approx({"progress_m": 3.0, "planks_shake_m": 0.02})


def test_stretched_chain_starts_a_spacing_apart() -> None:
    scene = scenes.build("stretched-chain", links=5)
    metres, _ = joint_errors(scene, scene.start_positions, scene.start_orientations)
    np.testing.assert_allclose(metres, [0.05, 0.1, 0.1, 0.1, 0.1])
    together = scene.start_positions / 2
    metres, _ = joint_errors(scene, together, scene.start_orientations)
    np.testing.assert_allclose(metres, 0, atol=1e-12)
    overshoot = scene.quantities["overshoot_m"]
    assert overshoot(together, scene.start_orientations) == pytest.approx(0, abs=1e-12)
    assert overshoot(0.7 * together, scene.start_orientations) == pytest.approx(0.03)


def test_card_house_cards_overlap_by_a_hair() -> None:
    fcl = pytest.importorskip("cairn.fcl", reason="cairn was built without FCL", exc_type=ImportError)
    scene = scenes.build("card-house")
    assert len(scene.bodies) == 1 + 2 * 15 + 10
    found = fcl.penetration(scene)
    assert found.worst == pytest.approx(1e-4, rel=0.1)
    # Every tent: two feet and an apex; every card across: two tents below it, and its neighbours of the same level.
    assert found.overlapping >= 3 * 15 + 2 * 10
    with pytest.raises(ValueError, match="degrees = 40"):
        scenes.build("card-house", degrees=40)


def test_arch_stones_share_their_faces() -> None:
    fcl = pytest.importorskip("cairn.fcl", reason="cairn was built without FCL", exc_type=ImportError)
    scene = scenes.build("arch")
    stones = [body for body in scene.bodies if isinstance(body.shape, Wedge)]
    assert len(stones) == 17 and len(scene.bodies) == 1 + 17 + 4
    found = fcl.penetration(scene, margin=1e-9)
    assert found.worst < 1e-12
    pairs = {tuple(sorted(pair)) for pair in found.pairs.tolist()}
    assert {(i, i + 1) for i in range(1, 17)} <= pairs and {(0, 1), (0, 17), (9, 18)} <= pairs
    with pytest.raises(ValueError, match="stones = 16"):
        scenes.build("arch", stones=16)


def test_kapla_is_simbenchmarks() -> None:
    scene = scenes.build("kapla")
    blocks = scene.bodies[1:]
    assert len(blocks) == 102 and scene.frames * scene.dt == pytest.approx(600)
    for body in blocks:  # their URDF files
        inertia = (
            (0.0604166667, 0.0541666667, 0.0104166667)
            if "base" in body.name
            else (0.0104166667, 0.0354166667, 0.0416666667)
        )
        assert body.inertia == pytest.approx(inertia)
    assert touching(scene) == pytest.approx(0, abs=1e-12)
    sunk = scene.start_positions - [0, 0.15, 0]
    assert scene.quantities["top_sinks_m"](sunk, scene.start_orientations) == pytest.approx(0.15)
    assert blocks[-1].position[1] == pytest.approx(1.15)


def test_rolling_balances_momentum() -> None:
    """What the accelerations of plate and balls take is what the push has over the floor's friction."""
    plate, ball = rolling_accelerations(150.0, 0.4)
    assert 10 * plate + 25 * ball == pytest.approx(150 - 0.4 * 35 * 9.8)
    assert ball + 2.5 * ball == pytest.approx(plate)  # centre and spin: the surface goes with the plate
    scene = scenes.build("rolling")
    assert scene.bodies[0].friction * scene.bodies[1].friction == pytest.approx(0.4)
    assert scene.bodies[1].friction * scene.bodies[2].friction == pytest.approx(0.8)
    error = scene.motions["velocity_error_m_s"]
    velocities = np.zeros((len(scene.bodies), 6))
    way = np.array([0.5, 0, -math.sqrt(0.75)])
    velocities[1, :3], velocities[2, :3] = 2 * plate * way, 2 * ball * way
    assert error(2.0, velocities) == pytest.approx(0, abs=1e-12)
    velocities[1, 0] += 0.3
    velocities[2, 1] += 0.4
    assert error(2.0, velocities) == pytest.approx(0.5)
    with pytest.raises(ValueError, match="force = 100"):
        scenes.build("rolling", force=100)


def test_squared_depths_count_every_pair() -> None:
    scene = scenes.build("666", edge=2)
    squared = scene.quantities["squared_depths_m2"]
    apart = np.add(scene.start_positions, [0, 10, 0])
    assert squared(apart, scene.start_orientations) == 0
    apart[1] = [0, 0.4, 0]  # 0.1 in the floor
    apart[3] = [0, 0.4 + 0.8, 0]  # 0.2 in the other
    assert squared(apart, scene.start_orientations) == pytest.approx(0.01 + 0.04)


def test_warm_removal_measures_the_jump() -> None:
    scene = scenes.build("warm-removal", side=2, layers=2)
    assert [body.removed_at for body in scene.bodies] == [None] * 9 + [120]
    assert scene.masses[-1] == 100 * scene.masses[1]
    assert touching(scene) == pytest.approx(0, abs=1e-12)
    higher = scene.start_positions
    higher[-1] += [0, 9, 0]  # the plate's does not count
    higher[4] += [0, 0.2, 0]
    assert scene.quantities["jump_m"](higher, scene.start_orientations) == pytest.approx(0.2)


@pytest.mark.parametrize(("name", "home"), [("far", "stack"), ("far-chain", "chain")])
def test_far_is_the_same_elsewhere(name: str, home: str) -> None:
    scene, origin = scenes.build(name, kilometres=3), scenes.build(home)
    moves = scene.masses > 0
    np.testing.assert_allclose(
        (scene.start_positions - origin.start_positions)[moves], [[3000, 0, 0]] * int(moves.sum())
    )
    np.testing.assert_allclose(scene.masses, origin.masses)
    metres, radians = joint_errors(scene, scene.start_positions, scene.start_orientations)
    assert max(metres.max(initial=0), radians.max(initial=0)) < 1e-9


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


def test_wedge_by_integration() -> None:
    """Against a sum over thin slices across its height; without a slope it is a box."""
    shape = Wedge(0.3, 0.5, 0.8, 0.35)
    y = (np.arange(20000) + 0.5) / 20000 * shape.height
    half = shape.half_bottom + (shape.half_top - shape.half_bottom) * y / shape.height
    weight = half / half.sum()
    assert np.sum(weight * y) == pytest.approx(shape.centre_height, rel=1e-6)
    xx, yy, zz = np.sum(weight * half**2 / 3), np.sum(weight * (y - shape.centre_height) ** 2), shape.half_depth**2 / 3
    assert Body(shape, 2.0).inertia == pytest.approx((2 * (yy + zz), 2 * (xx + zz), 2 * (xx + yy)), rel=1e-6)
    assert Body(Wedge(0.3, 0.3, 0.8, 0.35), 2.0).inertia == pytest.approx(Body(Box((0.3, 0.4, 0.35)), 2.0).inertia)
    corners = np.array(shape.vertices)
    for a, b, c, d in shape.faces:  # flat, and seen from outside
        normal = np.cross(corners[b] - corners[a], corners[c] - corners[b])
        assert normal @ corners[a] > 0 and normal @ (corners[d] - corners[a]) == pytest.approx(0)


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
