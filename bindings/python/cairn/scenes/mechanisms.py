"""`joints` and `crank`: each kind of joint alone, and all of them in one machine."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from .model import BALL, FIXED, HINGE, SLIDER, Array, Body, Box, Joint, Scene, Shape, Sphere, Vec3


def joints(arm: float = 0.5, mass: float = 1.0, speed: float = 0.25) -> Scene:
    """One pair of bodies for each kind of joint: does a joint hold what it locks and leave free what it frees?

    In each pair a body of `mass` (kg) reaches out from a post that cannot move, its centre `arm` (m) from the anchor.
    All moves along free axes: a pendulum that also circles and spins (ball), a pendulum (hinge) and a carriage on a
    horizontal rail at `speed` (m/s, slider); a cantilever stays as it is (fixed).
    """
    why = "One pair of bodies for each kind of joint: does a joint hold what it locks and leave free what it frees?"
    post = Box((0.1, 0.1, 0.1))
    reach = Box((arm, 0.1 * arm, 0.15 * arm))
    bodies = []
    links = []
    for i, kind in enumerate((BALL, HINGE, SLIDER, FIXED)):
        anchor: Vec3 = (0.0, 0.0, 4 * arm * i)
        linear: Vec3 = (0.0, 0.0, 0.0)
        angular: Vec3 = (0.0, 0.0, 0.0)
        if kind == BALL:  # circles the vertical at 1 rad/s and spins about its own arm
            linear, angular = (0.0, 0.0, -arm), (2.0, 1.0, 0.0)
        elif kind == SLIDER:
            linear = (speed, 0.0, 0.0)
        axis: Vec3 = (1.0, 0.0, 0.0) if kind == SLIDER else (0.0, 0.0, 1.0)
        bodies.append(Body(post, 0.0, anchor, name=f"{kind} post", collision_group=-1))
        centre = (arm, 0.0, anchor[2])
        moving = Body(
            reach, mass, centre, linear_velocity=linear, angular_velocity=angular, name=kind, collision_group=-1
        )
        bodies.append(moving)
        links.append(Joint(kind, 2 * i, 2 * i + 1, anchor, axis))
    settings = {"arm": arm, "mass": mass, "speed": speed}
    return Scene("joints", why, "max_joint_error_m", bodies, links, settings=settings)


def piston_position(angle: float, crank_length: float, rod_length: float) -> float:
    """Distance (m) of the piston's pin from the crank's axis at a crank angle (rad, 0: stretched out)."""
    return crank_length * math.cos(angle) + math.sqrt(rod_length**2 - (crank_length * math.sin(angle)) ** 2)


def _piston_error(positions: Array, orientations: Array, *, crank_length: float, rod_length: float) -> float:
    """Distance (m) of the piston from where the crank's angle says that it is."""
    _, _, z, w = orientations[0]
    expected = piston_position(2 * math.atan2(z, w), crank_length, rod_length)
    return float(np.linalg.norm(positions[2] - np.array([expected, 0.0, 0.0])))


def crank(
    crank_length: float = 0.25, rod_length: float = 1.0, speed: float = 2 * math.pi, torque: float = 100.0
) -> Scene:
    """A motor turns a crank, which pushes a piston through a rod: the piston's place has a closed formula.

    The crank (1 kg, with a flywheel of 4 kg fixed to it) turns about z at the origin, driven to `speed` (rad/s) by at
    most `torque` (N m). The rod (1 kg) joins its end to the piston (2 kg), which slides along x. Lengths in m between
    the pins; rod_length must exceed crank_length. The machine starts at rest, stretched out.
    """
    if not rod_length > crank_length > 0:
        raise ValueError(f"crank: rod_length {rod_length} must exceed crank_length {crank_length}, itself above 0")
    why = "A crank drives a piston through a rod: hinges, a slider and a fixed joint in a loop with a closed formula."
    thick = 0.1 * crank_length
    pin = crank_length + rod_length  # where the piston starts
    parts: list[tuple[str, Shape, float, float]] = [  # name, shape, mass, centre on the x axis
        ("crank", Box((crank_length / 2, thick, thick)), 1.0, crank_length / 2),
        ("rod", Box((rod_length / 2, thick, thick)), 1.0, crank_length + rod_length / 2),
        ("piston", Box((2 * thick, 2 * thick, 2 * thick)), 2.0, pin),
        ("flywheel", Sphere(0.8 * crank_length), 4.0, 0.0),
    ]
    bodies = [Body(shape, mass, (x, 0.0, 0.0), name=name, collision_group=-1) for name, shape, mass, x in parts]
    # The world is b of the driven hinge, so it is the world that turns backwards as seen from the crank.
    links = [
        Joint(HINGE, 0, None, (0.0, 0.0, 0.0), motor_speed=-speed, motor_force=torque),
        Joint(HINGE, 0, 1, (crank_length, 0.0, 0.0)),
        Joint(HINGE, 1, 2, (pin, 0.0, 0.0)),
        Joint(SLIDER, 2, None, (pin, 0.0, 0.0), axis=(1.0, 0.0, 0.0)),
        Joint(FIXED, 0, 3, (0.0, 0.0, 0.0)),
    ]
    settings = {"crank_length": crank_length, "rod_length": rod_length, "speed": speed, "torque": torque}
    error = partial(_piston_error, crank_length=crank_length, rod_length=rod_length)
    return Scene("crank", why, "piston_error_m", bodies, links, settings=settings, quantities={"piston_error_m": error})
