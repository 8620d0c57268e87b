"""Scenes by name. Each is a function of its sizes that returns a `Scene`; `build` calls one by its name.

>>> from cairn import scenes
>>> scenes.build("stack", layers=8).masses.sum()
"""

from __future__ import annotations

import inspect
from typing import Callable

from .bridge import jeep_bridge
from .buildings import arch, card_house, kapla
from .chain import chain, chain_1m
from .far import far, far_chain
from .heaps import column, hub, inverted, mass_ratio, pile, pyramid, warm_removal
from .jointed import cantilever, heavy_pendulum, joint_grid, stretched_chain, windmill
from .mechanisms import crank, joints, piston_position
from .model import Body, Box, Capsule, Joint, Plane, Scene, Sphere, Wedge
from .motion import bounce, rolling, slope, spheres_666, tumble
from .overlap import overlap
from .stack import stack, stack_1m

SCENES: dict[str, Callable[..., Scene]] = {
    "stack": stack,
    "stack-1m": stack_1m,
    "chain": chain,
    "chain-1m": chain_1m,
    "overlap": overlap,
    "joints": joints,
    "crank": crank,
    "jeep-bridge": jeep_bridge,
    "windmill": windmill,
    "column": column,
    "pyramid": pyramid,
    "mass-ratio": mass_ratio,
    "inverted": inverted,
    "hub": hub,
    "pile": pile,
    "heavy-pendulum": heavy_pendulum,
    "joint-grid": joint_grid,
    "stretched-chain": stretched_chain,
    "cantilever": cantilever,
    "card-house": card_house,
    "arch": arch,
    "kapla": kapla,
    "slope": slope,
    "rolling": rolling,
    "bounce": bounce,
    "666": spheres_666,
    "warm-removal": warm_removal,
    "far": far,
    "far-chain": far_chain,
    "tumble": tumble,
}


def settings_of(name: str) -> dict[str, float]:
    """The sizes that a scene takes, by name, with their defaults. ValueError for an unknown scene."""
    if name not in SCENES:
        raise ValueError(f"no scene is called '{name}'; there are {', '.join(SCENES)}")
    return {p.name: p.default for p in inspect.signature(SCENES[name]).parameters.values()}


def build(name: str, /, **settings: float) -> Scene:
    """The scene of that name with some of its sizes changed. ValueError for an unknown scene, size or value."""
    defaults = settings_of(name)
    sizes: dict[str, float] = {}
    for key, value in settings.items():
        if key not in defaults:
            raise ValueError(f"scene '{name}' has no setting '{key}'; it has {', '.join(defaults)}")
        whole = isinstance(defaults[key], int)
        if whole and value != int(value):
            raise ValueError(f"{name}: {key} counts things, so {value} must be a whole number")
        if value < 0 or (whole and value < 1):
            raise ValueError(f"{name}: {key} = {value} must be {'at least 1' if whole else 'zero or more'}")
        sizes[key] = int(value) if whole else float(value)
    return SCENES[name](**sizes)


__all__ = [
    "SCENES", "Body", "Box", "Capsule", "Joint", "Plane", "Scene", "Sphere", "Wedge",
    "build", "chain", "chain_1m", "crank", "joints", "overlap", "piston_position",
    "settings_of", "stack", "stack_1m",
]  # fmt: skip
