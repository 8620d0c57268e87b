"""`chain` and `chain-1m`: a row of light links with a heavy ball at the end, the paper's mass-ratio test."""

from __future__ import annotations

from .model import HINGE, Body, Box, Joint, Scene, Sphere, Vec3


def _hanging(
    name: str, why: str, links: int, half_extents: Vec3, spacing: float, mass: float, mass_ratio: float, radius: float
) -> Scene:
    end = links * spacing
    group = 1  # nothing of the chain collides with the rest of it
    bodies = []
    joints = []
    for link in range(links):
        centre = ((link + 0.5) * spacing, 0.0, 0.0)
        bodies.append(Body(Box(half_extents), mass, centre, name=f"link {link}", collision_group=group))
        previous = link - 1 if link > 0 else None
        joints.append(Joint(HINGE, link, previous, (link * spacing, 0.0, 0.0)))
    ball = Body(Sphere(radius), mass_ratio * mass, (end + radius, 0.0, 0.0), name="ball", collision_group=group)
    bodies.append(ball)
    joints.append(Joint(HINGE, links, links - 1, (end, 0.0, 0.0)))
    settings = {"links": links, "spacing": spacing, "mass": mass, "mass_ratio": mass_ratio, "radius": radius}
    return Scene(name, why, "max_joint_error_m", bodies, joints, settings=settings)


def chain(
    links: int = 50, spacing: float = 0.1, mass: float = 0.009, mass_ratio: float = 300.0, radius: float = 1.25
) -> Scene:
    """A heavy ball swings on a chain of light links: do the anchors stay together?

    The chain starts as a horizontal row from the world's origin along x, hinged about z every `spacing` (m). mass is a
    link's (kg); the ball's is mass_ratio times that. radius is the ball's (m), which hangs by a point of its surface.
    Links are boxes of half size 0.25, 0.45 and 0.1 spacings.
    """
    why = "A ball 300 times a link's mass swings on a chain of 50: do the anchors stay together?"
    half_extents = (0.25 * spacing, 0.45 * spacing, 0.1 * spacing)
    return _hanging("chain", why, links, half_extents, spacing, mass, mass_ratio, radius)


def chain_1m(
    links: int = 50, spacing: float = 1.0, mass: float = 1.0, mass_ratio: float = 300.0, radius: float = 2.0
) -> Scene:
    """The same chain in metres and kilograms. Settings as for `chain`; half size 0.4, 0.2 and 0.2 spacings."""
    why = "The same chain with links of 1 m and 1 kg and a ball of 300 kg, which falls from rest through 50 m."
    half_extents = (0.4 * spacing, 0.2 * spacing, 0.2 * spacing)
    return _hanging("chain-1m", why, links, half_extents, spacing, mass, mass_ratio, radius)
