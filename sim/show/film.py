"""Films of what physics did: PNG frames, or MP4 where imageio-ffmpeg is installed; no screen needed."""

from __future__ import annotations

import importlib.util
import os
import struct
import sys
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mocca_robot.arrays import Array
from mocca_robot.errors import EnvironmentNeeded, InputError
from mocca_robot.files.output import make_folder, write_atomic
from mocca_robot.geometry.extrusion import surface
from mocca_robot.statics.loads import tilted_gravity
from sim.motion import Motion, run
from sim.scene import Compiled, Scene, compile_scene, spec, with_gravity
from sim.shapes.contact_model import embed
from sim.show.mjcf import colour

INSTALL_OPENGL = (
    "Install one: on Debian `apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri` (EGL, also without a graphics "
    "card) or `libosmesa6` (OSMesa). All numbers are available without it."
)

OUT_OF_SIGHT = 0.7
"""How far a part falls, relative to the assembly, until a film of it is over."""


@dataclass(frozen=True, kw_only=True)
class FilmOptions:
    """How a film looks.

    Attributes:
        width, height: pixels, even numbers.
        fps: frames per second of film time.
        slow_motion: film seconds per simulated second.
        azimuth_deg, elevation_deg: where the camera looks from; flat assemblies are seen from the front.
    """

    width: int = 640
    height: int = 480
    fps: int = 25
    slow_motion: float = 2.0
    azimuth_deg: float = 60.0
    elevation_deg: float = -20.0

    def __post_init__(self) -> None:
        if self.width < 16 or self.height < 16 or self.width % 2 or self.height % 2 or self.fps < 1:
            raise InputError(
                f"A film of {self.width} × {self.height} at {self.fps} frames per second cannot be made; "
                "width and height must be even and at least 16."
            )


def write_film(scene: Scene, motion: Motion, path: str | Path, options: FilmOptions | None = None) -> Path:
    """Return `path` after writing the film of `motion` there: a .mp4 file, else a folder of PNG frames.

    Raises EnvironmentNeeded when OpenGL, or for .mp4 imageio-ffmpeg, is missing.
    """
    options = options or FilmOptions()
    return write_images(render_motion(scene, motion, options), Path(path), options)


def write_images(images: Iterator[NDArray[np.uint8]], target: Path, options: FilmOptions) -> Path:
    """Return `target` after writing images (height, width, 3) there: a .mp4 file, else a folder of PNG frames."""
    if target.suffix.lower() == ".mp4":
        return _write_mp4(images, target, options)
    folder = make_folder(target)
    for number, frame in enumerate(images):
        write_atomic(folder / f"frame_{number:04d}.png", png(frame))
    return folder


def render_motion(scene: Scene, motion: Motion, options: FilmOptions | None = None) -> Iterator[NDArray[np.uint8]]:
    """Yield images (height, width, 3) of the motion at even times. Raises EnvironmentNeeded without OpenGL."""
    options = options or FilmOptions()
    compiled = compile_scene(scene)
    duration = float(motion.times[-1])
    count = max(2, round(duration * options.slow_motion * options.fps) + 1)

    def put_states(data: Any) -> Iterator[None]:
        for time in np.linspace(0.0, duration, count):
            nearest = int(np.abs(motion.times - time).argmin())
            data.qpos[compiled.qpos] = motion.poses[nearest]
            yield

    yield from render(visible_spec(scene), _camera(scene, options), put_states, options)


def render(
    model: Any, camera: Any, put_states: Callable[[Any], Iterator[None]], options: FilmOptions
) -> Iterator[NDArray[np.uint8]]:
    """Yield an image (height, width, 3) of the MjSpec `model` for every state that `put_states` puts into its MjData.

    Raises EnvironmentNeeded without OpenGL.
    """
    with _opengl(options):
        import mujoco

        compiled = _light(model, options).compile()
        data = mujoco.MjData(compiled)
        context = mujoco.MjrContext(compiled, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
        view = mujoco.MjvScene(compiled, maxgeom=4 * compiled.ngeom + 100)
        settings = mujoco.MjvOption()
        box = mujoco.MjrRect(0, 0, options.width, options.height)
        image = np.zeros((options.height, options.width, 3), dtype=np.uint8)
        for _ in put_states(data):
            mujoco.mj_forward(compiled, data)
            mujoco.mjv_updateScene(compiled, data, settings, None, camera, mujoco.mjtCatBit.mjCAT_ALL, view)
            mujoco.mjr_render(box, view, context)
            mujoco.mjr_readPixels(image, None, box, context)
            yield np.ascontiguousarray(image[::-1])
        context.free()


def platform_motion(
    compiled: Compiled, azimuth_rad: float, angle_rad: float, rate_rad_s: float = float(np.deg2rad(5.0))
) -> Motion:
    """Return the motion on a platform that tilts steadily up to `angle_rad`, as its rider sees it.

    It ends a second later, or when a part has fallen out of sight. For the film: the critical angle read off a ramp is
    up to 2° too large (see `sim.tilt`).
    """
    gravity = compiled.scene.assembly.gravity
    tilting = with_gravity(compiled, gravity)
    size = compiled.scene.assembly.size

    def turn(time: float, displacement: Array, speed: Array) -> bool:
        angle = min(angle_rad, rate_rad_s * time)
        tilting.model.opt.gravity[:] = embed(tilted_gravity(gravity, angle, azimuth_rad))
        return bool(displacement.max(initial=0.0) > OUT_OF_SIGHT * size)

    duration = angle_rad / rate_rad_s + 1.0
    # Turning gravity feeds energy in, so energy is not watched here.
    return run(tilting, duration, turn, samples=round(duration / 0.02), watch_energy=False)


def png(image: NDArray[np.uint8]) -> bytes:
    """Return an (h, w, 3) image as a PNG file."""
    height, width, _ = image.shape
    rows = np.concatenate([np.zeros((height, 1), dtype=np.uint8), image.reshape(height, -1)], axis=1)

    def chunk(kind: bytes, content: bytes) -> bytes:
        body = kind + content
        return struct.pack(">I", len(content)) + body + struct.pack(">I", zlib.crc32(body))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    packed = zlib.compress(rows.tobytes(), 6)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")


def require_encoder(path: Path) -> None:
    """Raise EnvironmentNeeded when a film to `path` needs what is not installed: better before the run than after."""
    if path.suffix == ".mp4" and importlib.util.find_spec("imageio_ffmpeg") is None:
        raise EnvironmentNeeded(
            "An MP4 film needs imageio-ffmpeg: `pip install mocca-robot[film]`. PNG frames need nothing: give a folder."
        )


def _write_mp4(images: Iterator[NDArray[np.uint8]], path: Path, options: FilmOptions) -> Path:
    require_encoder(path)
    import imageio_ffmpeg

    first = next(images)
    make_folder(path.parent)
    size = (options.width, options.height)
    writer = imageio_ffmpeg.write_frames(str(path), size, fps=options.fps, macro_block_size=2, ffmpeg_log_level="error")
    writer.send(None)
    try:
        writer.send(first.tobytes())
        for image in images:
            writer.send(image.tobytes())
    finally:
        writer.close()
    return path


@contextmanager
def _opengl(options: FilmOptions) -> Iterator[None]:
    """A context without a screen: EGL, or OSMesa, or what MUJOCO_GL says."""
    wanted = os.environ.get("MUJOCO_GL", "").lower()
    kinds = [wanted] if wanted in ("egl", "osmesa") else ["egl", "osmesa"]
    problems = []
    for kind in kinds:
        try:
            context = _context(kind, options)
            context.make_current()  # without libOSMesa this is what fails
        except Exception as error:  # missing libraries show as ImportError, AttributeError, RuntimeError, …
            problems.append(f"{kind}: {error}")
            continue
        try:
            yield
        finally:
            context.free()
        return
    raise EnvironmentNeeded(f"Films need OpenGL, and none could be opened ({'; '.join(problems)}). {INSTALL_OPENGL}")


def _context(kind: str, options: FilmOptions) -> Any:
    import mujoco

    if "OpenGL" not in sys.modules:
        os.environ.setdefault("PYOPENGL_PLATFORM", kind)
    if kind == "egl":
        from mujoco.egl import GLContext
    else:
        from mujoco.osmesa import GLContext
    assert mujoco is not None
    return GLContext(options.width, options.height)


def visible_spec(scene: Scene) -> Any:
    """Return the MjSpec with the parts' surfaces to look at and the collision shapes hidden."""
    import mujoco

    out = spec(scene)
    for geom in out.geoms:
        geom.group = 4
    for index in np.flatnonzero(scene.present):
        part = scene.assembly.parts[int(index)]
        mesh = surface(part)
        name = f"{part.name}/surface"
        out.add_mesh(
            name=name,
            uservert=(mesh.vertices - embed(part.centroid)).ravel(),
            userface=mesh.faces.ravel().astype(np.int32),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        out.body(part.name).add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=name,
            mass=0.0,
            contype=0,
            conaffinity=0,
            group=1,
            rgba=[*colour(scene.assembly, int(index)), 1.0],
        )
    return out


def _light(out: Any, options: FilmOptions) -> Any:
    """Return the MjSpec with light, background and an image of the right size."""
    import mujoco

    visual = out.visual.global_
    visual.offwidth, visual.offheight = options.width, options.height
    out.visual.quality.offsamples = 0
    out.visual.quality.shadowsize = 0
    out.visual.headlight.ambient = [0.45, 0.45, 0.45]
    out.visual.headlight.diffuse = [0.5, 0.5, 0.5]
    out.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=[1, 1, 1],
        rgb2=[1, 1, 1],
        width=16,
        height=96,
    )
    return out


def _camera(scene: Scene, options: FilmOptions) -> Any:
    import mujoco

    bounds = np.array([p.shape.bounds for p in scene.assembly.parts])
    low, high = embed(bounds[:, 0].min(axis=0)), embed(bounds[:, 1].max(axis=0))
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat[:] = 0.5 * (low + high)
    camera.distance = 1.6 * float(np.linalg.norm(high - low))
    flat = scene.assembly.dimension == 2
    camera.azimuth = 90.0 if flat else options.azimuth_deg
    camera.elevation = 0.0 if flat else options.elevation_deg
    return camera
