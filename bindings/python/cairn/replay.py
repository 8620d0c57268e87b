"""Animated 3D replays of recorded runs, as web pages that stand alone: play, pause, scrub, turn with the mouse.

    >>> from cairn.run import run
    >>> recording = run("stack", "tj", frames=600, keep_poses_every=8)
    >>> replay.save("stack.html", [replay.Take("TJ", scenes.build("stack"), recording)])

Several takes of a scene stand beside one another in one view and play together. The viewer is viser's.
"""

from __future__ import annotations

import colorsys
import contextlib
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .scenes.model import Box, Capsule, Plane, Scene, Shape, Sphere, Wedge

if TYPE_CHECKING:
    from .recording import Recording

Array = npt.NDArray[np.float64]

COLOUR = "#0072B2"
_DATA = re.compile(r'(?<=__VISER_EMBED_DATA__=")[^"]*')
_STEP = 2.0**-12  # positions (m) and quaternions are rounded to this: a body at rest then costs nothing


@dataclass(frozen=True)
class Take:
    """A run to show: its scene, its recording with poses, and the colour of its bodies (#rrggbb)."""

    label: str
    scene: Scene
    recording: Recording
    colour: str = COLOUR


@dataclass(frozen=True)
class Page:
    """A replay in two parts, so that many replays in one page need the viewer only once."""

    viewer: str  # the HTML of the viewer, with @DATA@ where the data belongs
    data: str  # base64

    @property
    def html(self) -> str:
        return self.viewer.replace("@DATA@", self.data)


def save(path: str | Path, takes: Sequence[Take], *, seconds_per_sample: float | None = None) -> None:
    """Write a replay as one HTML file; arguments as for `page`."""
    Path(path).write_text(page(takes, seconds_per_sample=seconds_per_sample).html, encoding="utf-8")


def page(takes: Sequence[Take], *, seconds_per_sample: float | None = None) -> Page:
    """Render takes, side by side, as a replay.

    seconds_per_sample: s of the replay from one kept pose to the next; the simulated time, so real time, unless given.
    ValueError if a recording has no poses (run with keep_poses_every > 0). A body whose pose is not finite stays where
    it last was.
    """
    if not takes:
        raise ValueError("a replay needs at least one take")
    for take in takes:
        if take.recording.poses is None or not len(take.recording.poses):
            raise ValueError(f"'{take.label}' kept no poses: run it with keep_poses_every=8, or any number above 0")
    try:
        import viser
    except ImportError as error:
        raise ImportError("replays need the viser package: pip install viser") from error
    with contextlib.redirect_stdout(io.StringIO()):  # viser announces its address, which nobody is to visit
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        html = _record(server, takes, seconds_per_sample)
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()
    found = _DATA.search(html)
    if found is None:
        raise RuntimeError("this version of viser packs its pages otherwise: install viser 1.0 or later 1.x")
    return Page(viewer=_DATA.sub("@DATA@", html), data=found.group())


def sample_seconds(recording: Recording) -> float:
    """Simulated seconds from one kept pose to the next."""
    frames = recording.pose_frames
    return float(recording.summary["dt"]) * (float(frames[1] - frames[0]) if len(frames) > 1 else 1.0)


def _record(server: Any, takes: Sequence[Take], seconds_per_sample: float | None) -> str:
    scene = server.scene
    scene.set_up_direction("+y")
    scene.configure_default_lights(cast_shadow=False)
    scene.configure_environment_map(environment_intensity=0.45)  # all of it washes the colours out
    tracks = [_finite(np.asarray(take.recording.poses, dtype=np.float64)) for take in takes]
    offsets, low, high = _places(takes)
    _camera(server, *_seen(takes[0].scene, tracks, offsets, low, high))
    _floors(scene, takes[0].scene, low, high)
    groups = []
    for index, (take, track, offset) in enumerate(zip(takes, tracks, offsets)):
        top = high[1] + 0.08 * float(np.linalg.norm(high - low))
        centre = (_extent(take.scene)[0] + _extent(take.scene)[1]) / 2 + offset
        scene.add_label(
            f"/takes/{index}/label", take.label, position=(centre[0], top, centre[2]), anchor="bottom-center"
        )
        for number, (shape, bodies) in enumerate(_by_shape(take.scene).items()):
            mesh = _mesh(shape)
            positions, turns = _instances(track[0], bodies, offset)
            handle = scene.add_batched_meshes_simple(
                f"/takes/{index}/{number}", mesh.vertices, mesh.faces, batched_wxyzs=turns, batched_positions=positions,
                batched_colors=_shades(take.colour, len(bodies)), flat_shading=isinstance(shape, Box), lod="off",
                cast_shadow=False, receive_shadow=False,
            )  # fmt: skip
            groups.append((handle, track, bodies, offset))
    recorder = server.get_scene_serializer()
    pause = sample_seconds(takes[0].recording) if seconds_per_sample is None else seconds_per_sample
    for sample in range(max(len(track) for track in tracks)):
        for handle, track, bodies, offset in groups:
            positions, turns = _instances(track[min(sample, len(track) - 1)], bodies, offset)
            handle.batched_positions = positions
            handle.batched_wxyzs = turns
        recorder.insert_sleep(pause)
    return str(recorder.as_html())


def _finite(poses: Array) -> Array:
    """Poses with what is not finite replaced by the body's last finite pose."""
    poses = poses.copy()
    for sample in range(len(poses)):
        bad = ~np.isfinite(poses[sample]).all(axis=1)
        poses[sample, bad] = poses[sample - 1, bad] if sample else (0, 0, 0, 0, 0, 0, 1)
    return poses


def _half_size(shape: Shape) -> Array:
    if isinstance(shape, Box):
        return np.asarray(shape.half_extents, dtype=np.float64)
    if isinstance(shape, Sphere):
        return np.full(3, shape.radius)
    if isinstance(shape, Capsule):
        return np.array([shape.radius, shape.radius + shape.half_length, shape.radius])
    if isinstance(shape, Wedge):
        return np.asarray(np.abs(shape.vertices).max(axis=0), dtype=np.float64)
    return np.zeros(3)


def _extent(scene: Scene) -> tuple[Array, Array]:
    """Corners of the box round a scene as it starts (m), planes apart; bodies are taken as unturned."""
    solid = [body for body in scene.bodies if not isinstance(body.shape, Plane)]
    centres = np.array([body.position for body in solid], dtype=np.float64)
    halves = np.array([_half_size(body.shape) for body in solid])
    return (centres - halves).min(axis=0), (centres + halves).max(axis=0)


def _places(takes: Sequence[Take]) -> tuple[list[Array], Array, Array]:
    """Offset of each take, side by side along their thinner horizontal axis, and corners of the box round them all."""
    low, high = _extent(takes[0].scene)
    size = high - low
    along = 0 if size[0] <= size[2] * 1.01 else 2
    spacing = size[along] * 1.3 + 0.12 * float(np.linalg.norm(size))
    offsets = [np.zeros(3) for _ in takes]
    for index, offset in enumerate(offsets):
        offset[along] = (index - (len(takes) - 1) / 2) * spacing
    return offsets, low + offsets[0], high + offsets[-1]


def _seen(
    scene: Scene, tracks: Sequence[Array], offsets: Sequence[Array], low: Array, high: Array
) -> tuple[Array, Array]:
    """Corners of the box to show: the start, and as far as the calmest take goes; others may leave the view."""
    solid = [index for index, body in enumerate(scene.bodies) if not isinstance(body.shape, Plane)]
    lows = [np.percentile(track[:, solid, :3], 2, axis=(0, 1)) for track in tracks]
    highs = [np.percentile(track[:, solid, :3], 98, axis=(0, 1)) for track in tracks]
    calmest = int(np.argmin([np.linalg.norm(top - bottom) for bottom, top in zip(lows, highs)]))
    return np.minimum(low, lows[calmest] + offsets[0]), np.maximum(high, highs[calmest] + offsets[-1])


def _camera(server: Any, low: Array, high: Array) -> None:
    """Above and before the middle, as near as the box allows in a view that is twice as wide as high."""
    middle = (low + high) / 2
    # Along the row's normal, turned a little so that depth shows.
    aim = np.array([0.2, 0.38, 1.0]) if high[0] - low[0] >= high[2] - low[2] else np.array([1.0, 0.45, 0.8])
    aim /= np.linalg.norm(aim)
    right = np.cross((0.0, 1.0, 0.0), aim)
    right /= np.linalg.norm(right)
    up = np.cross(aim, right)
    corners = np.array(np.meshgrid(*zip(low, high))).reshape(3, -1).T - middle
    fov = np.deg2rad(40.0)
    # Each corner must lie inside the view: |x| <= 2 tan * depth and |y| <= tan * depth, with a margin.
    reach = np.maximum(np.abs(corners @ right) / 2, np.abs(corners @ up)) / (0.92 * np.tan(fov / 2))
    distance = float(np.max(reach + corners @ aim))
    server.initial_camera.fov = float(fov)
    server.initial_camera.look_at = tuple(middle)
    server.initial_camera.position = tuple(middle + aim / np.linalg.norm(aim) * distance)
    server.initial_camera.far = 100.0 * distance


def _floors(scene: Any, world: Scene, low: Array, high: Array) -> None:
    planes = [body.shape for body in world.bodies if isinstance(body.shape, Plane)]
    reach = 3.0 * float(np.linalg.norm(high - low))
    cell = 10.0 ** np.floor(np.log10(reach / 10))
    middle = (low + high) / 2
    for index, plane in enumerate(planes):
        normal = np.asarray(plane.normal, dtype=np.float64)
        on_plane = middle - (middle @ normal - plane.offset) * normal
        scene.add_grid(f"/floors/{index}", width=reach, height=reach, plane="xz", shadow_opacity=0.0, cell_size=cell,
                       section_size=10 * cell, wxyz=_turn_from_up(normal), position=tuple(on_plane))  # fmt: skip


def _turn_from_up(normal: Array) -> tuple[float, float, float, float]:
    """w, x, y, z of the shortest turn from +y to a unit normal."""
    w, (x, y, z) = 1.0 + normal[1], np.cross((0.0, 1.0, 0.0), normal)
    if w < 1e-9:
        return (0.0, 1.0, 0.0, 0.0)
    length = float(np.sqrt(w * w + x * x + y * y + z * z))
    return (w / length, x / length, y / length, z / length)


def _by_shape(scene: Scene) -> dict[Shape, list[int]]:
    """Indices of the bodies of each shape, planes apart: one instanced mesh a shape."""
    groups: dict[Shape, list[int]] = {}
    for index, body in enumerate(scene.bodies):
        if not isinstance(body.shape, Plane):
            groups.setdefault(body.shape, []).append(index)
    return groups


def _mesh(shape: Shape) -> Any:
    import trimesh.creation as creation

    if isinstance(shape, Box):
        return creation.box(extents=2 * _half_size(shape))
    if isinstance(shape, Sphere):
        return creation.icosphere(subdivisions=3, radius=shape.radius)
    if isinstance(shape, Capsule):
        mesh = creation.capsule(height=2 * shape.half_length, radius=shape.radius, count=[24, 24])
        mesh.apply_transform([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])  # from along z to along y
        return mesh
    if isinstance(shape, Wedge):
        from trimesh import Trimesh

        return Trimesh(shape.vertices, [[a, b, c] for a, *rest in shape.faces for b, c in zip(rest, rest[1:])])
    raise TypeError(f"no mesh for {shape!r}")


def _instances(
    poses: Array, bodies: Sequence[int], offset: Array
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Positions [bodies, 3] and quaternions w, x, y, z [bodies, 4], rounded."""
    chosen = poses[list(bodies)]
    positions = np.round((chosen[:, :3] + offset) / _STEP) * _STEP
    turns = np.round(chosen[:, [6, 3, 4, 5]] / _STEP) * _STEP
    return positions.astype(np.float32), turns.astype(np.float32)


def _shades(colour: str, count: int) -> npt.NDArray[np.uint8]:
    """[count, 3]: the take's colour, body by body a little lighter or darker, so that neighbours are told apart."""
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    hue, light, saturation = colorsys.rgb_to_hls(red, green, blue)
    shades = []
    for index in range(count):
        lightness = min(0.85, max(0.2, light + 0.11 * ((index * 0.618) % 1.0 * 2 - 1)))
        shades.append(colorsys.hls_to_rgb(hue, lightness, saturation))
    return np.round(np.array(shades) * 255).astype(np.uint8)
