"""Print beds: every part once, apart, inside the bed, lying flat; numbers are cut where nothing touches."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from solids import box

from mocca_robot.contacts.find import find_contacts
from mocca_robot.errors import InputError
from mocca_robot.fabrication.print_bed import engraved, print_beds, write_beds
from mocca_robot.files.meshes import read_parts
from mocca_robot.generators import generate


def test_parts_lie_apart_on_their_beds(tmp_path):
    dome = generate("dome", {"blocks": [9, 8, 6], "radius": 0.15, "thickness": 0.03})
    beds = print_beds(dome, (0.22, 0.22), gap=0.004)
    assert sorted(p.name for bed in beds for p in bed) == sorted(dome.sequence)
    for bed in beds:
        boxes = np.array([p.mesh.bounds for p in bed])
        assert boxes[:, 0].min() >= -1e-12
        assert boxes[:, 1, :2].max() <= 0.22 + 1e-12
        for k, a in enumerate(boxes):
            for b in boxes[:k]:
                apart = np.maximum(a[0] - b[1], b[0] - a[1])[:2]
                assert apart.max() >= 0.004 - 1e-9
    placed = {p.name: p.mesh.volume for bed in beds for p in bed}
    for part in dome.parts:
        assert placed[part.name] == pytest.approx(part.shape.volume, rel=1e-9)
    files = write_beds(beds, tmp_path)
    assert sum(len(read_parts(f)) for f in files) == len(dome.parts)


def test_numbers_are_engraved_away_from_contacts():
    wall = generate("wall", {"courses": 2, "columns": 2})
    contacts = find_contacts(wall).contacts
    for bed in print_beds(wall, (0.5, 0.5), label_depth=0.001, contacts=contacts):
        for placed in bed:
            before = wall.parts[wall.index(placed.name)].shape.volume
            assert trimesh.Trimesh(placed.mesh.vertices, placed.mesh.faces, process=False).is_watertight
            assert 0.98 * before < placed.mesh.volume < before
    cut = engraved(box((0, 0, 0), (1, 1, 1)), "7", 0.01, [(np.array([0, 0, 1.0]), np.array([0, 0, 1.0]))])
    inside = cut.vertices[(np.abs(cut.vertices - 0.5) < 0.499).all(axis=1)]
    assert len(inside)
    assert inside[:, 2].max() < 0.985


def test_a_part_larger_than_the_bed_is_named():
    with pytest.raises(InputError, match=r"Part 'block_01' needs .* the bed has 0\.05"):
        print_beds(generate("stack", {"count": 2}), (0.05, 0.05))
