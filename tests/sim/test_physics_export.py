"""What other programs and eyes get: MJCF, URDF and films say the same as the model they come from."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest
import trimesh
from physics_models import box_stack_3d, jointed, stack

from mocca_robot.errors import EnvironmentNeeded, InputError
from mocca_robot.geometry.extrusion import surface
from mocca_robot.statics.loads import tilted_gravity
from sim.motion import Motion, run
from sim.scene import compile_scene
from sim.shapes.contact_model import contact_model, facets
from sim.show.film import OUT_OF_SIGHT, FilmOptions, platform_motion, png, render_motion, write_film
from sim.show.mjcf import export_mjcf, export_urdf
from sim.stability import free_scene, stability

SMALL = FilmOptions(width=64, height=48, fps=10, slow_motion=1.0)


def scene_2d(angle: float = 0.0):
    assembly, contacts = jointed(stack(2))
    return free_scene(assembly, contact_model(assembly, contacts), gravity=tilted_gravity(assembly.gravity, angle))


def scene_3d():
    assembly, contacts = box_stack_3d(2)
    return free_scene(assembly, facets(contacts), friction=0.5)


@pytest.mark.parametrize("make", [scene_2d, scene_3d])
def test_the_exported_folder_behaves_the_same(make, tmp_path):
    import mujoco

    scene = make()
    path = export_mjcf(scene, tmp_path / "model")
    moved = (tmp_path / "model").rename(tmp_path / "elsewhere")
    again = mujoco.MjModel.from_xml_path(str(moved / path.name))
    model = compile_scene(scene).model
    assert again.npair == model.npair and again.nv == model.nv
    moving = model.body_dofnum > 0
    np.testing.assert_allclose(again.body_mass[moving], model.body_mass[moving], rtol=1e-5)
    first, second = mujoco.MjData(model), mujoco.MjData(again)
    for _ in range(200):
        mujoco.mj_step(model, first)
        mujoco.mj_step(again, second)
    np.testing.assert_allclose(second.qpos, first.qpos, atol=2e-6)
    assert not second.warning.number.any()


@pytest.mark.parametrize("make", [lambda: jointed(stack(1))[0], lambda: box_stack_3d(1)[0]])
def test_every_part_becomes_a_urdf_with_its_mass(make, tmp_path):
    assembly = make()
    paths = export_urdf(assembly, tmp_path)
    assert len(paths) == len(assembly.parts)
    for path, part in zip(paths, assembly.parts):
        link = ET.parse(path).getroot().find("link")
        assert float(link.find("inertial/mass").get("value")) == pytest.approx(part.mass)
        mesh = trimesh.load_mesh(path.parent / link.find("visual/geometry/mesh").get("filename"))
        assert mesh.is_watertight and mesh.volume == pytest.approx(part.shape.volume)
        np.testing.assert_allclose(mesh.center_mass, 0.0, atol=1e-9)


def test_surfaces_are_closed_and_outward():
    for part in jointed(stack(2), 0.25)[0].parts:
        found = surface(part)
        mesh = trimesh.Trimesh(found.vertices, found.faces, process=False)
        assert mesh.is_watertight and mesh.is_winding_consistent
        assert found.volume == pytest.approx(part.shape.volume)


def opengl_or_reason(scene, motion: Motion):
    """Return frames; or None where OpenGL is missing and the error says what to install."""
    try:
        return list(render_motion(scene, motion, SMALL))
    except EnvironmentNeeded as error:
        assert "libegl1" in str(error)
        return None


def test_a_film_shows_the_collapse(tmp_path):
    scene = scene_2d(np.deg2rad(30.0))
    motion = run(compile_scene(scene), 0.6)
    images = opengl_or_reason(scene, motion)
    if images is None:
        return
    assert all(i.shape == (48, 64, 3) for i in images)
    assert images[0].std() > 1.0
    assert (images[0] != images[-1]).any()
    folder = write_film(scene, motion, tmp_path / "film", SMALL)
    assert len(list(folder.glob("frame_*.png"))) == len(images)


def test_without_opengl_the_error_says_what_to_install(monkeypatch):
    def missing(kind, options):
        raise ImportError(f"no {kind}")

    monkeypatch.setattr("sim.show.film._context", missing)
    scene = scene_2d()
    with pytest.raises(EnvironmentNeeded, match="apt-get install libegl1"):
        next(render_motion(scene, stability(scene).motion, SMALL))


def test_a_steady_platform_carries_the_stack_until_it_lets_go():
    scene = scene_2d()
    motion = platform_motion(compile_scene(scene), 0.0, np.deg2rad(25.0), np.deg2rad(20.0))
    assert motion.failure is None
    far = motion.displacement.max(axis=1)
    assert far[motion.times < 0.3].max() < 1e-4 and far[-1] > 0.01


def test_a_film_of_a_fall_ends_when_a_part_is_out_of_sight():
    scene = scene_2d()
    compiled = compile_scene(scene)
    motion = platform_motion(compiled, 0.0, np.deg2rad(80.0), np.deg2rad(40.0))
    gone = OUT_OF_SIGHT * scene.assembly.size
    assert motion.times[-1] < 2.9 and motion.displacement[-1].max() > gone >= motion.displacement[-2].max()


def test_png_files_hold_the_image():
    import io

    pillow = pytest.importorskip("PIL.Image")
    image = np.random.default_rng(0).integers(0, 255, (6, 9, 3), dtype=np.uint8)
    np.testing.assert_array_equal(np.asarray(pillow.open(io.BytesIO(png(image)))), image)


def test_odd_film_sizes_are_refused():
    with pytest.raises(InputError, match="even"):
        FilmOptions(width=641)
