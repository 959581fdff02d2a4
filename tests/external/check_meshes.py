"""check_meshes.py PART.stl ...: independent opinions on each mesh: trimesh's, the Manifold kernel's, MeshLab's."""

import sys

import manifold3d
import numpy
import pymeshlab
import trimesh


def self_intersections(path):
    """Number of faces that cut another one."""
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.load_new_mesh(path)
    meshes.meshing_remove_duplicate_vertices()
    meshes.compute_selection_by_self_intersections_per_face()
    return meshes.current_mesh().selected_face_number()


failed = False
for path in sys.argv[1:]:
    mesh = trimesh.load(path)
    # STL repeats every vertex: equal ones are one, near ones are not.
    mesh.merge_vertices(digits_vertex=None)
    solid = manifold3d.Manifold(
        manifold3d.Mesh(numpy.asarray(mesh.vertices, numpy.float32), numpy.asarray(mesh.faces, numpy.uint32))
    )
    checks = {
        "watertight": mesh.is_watertight,
        "consistently oriented": mesh.is_winding_consistent,
        "encloses a volume": mesh.is_volume and mesh.volume > 0,
        "manifold": solid.status() == manifold3d.Error.NoError,
        "the same volume to both": abs(solid.volume() - mesh.volume) <= 1e-4 * abs(mesh.volume),
        "free of self-intersections": self_intersections(path) == 0,
    }
    parts = mesh.body_count
    checks["one piece"] = parts == 1
    bad = [name for name, holds in checks.items() if not holds]
    failed = failed or bool(bad)
    verdict = "FAIL: not " + ", not ".join(bad) if bad else "ok"
    print(f"{path}: {len(mesh.faces)} triangles, {mesh.volume:.1f} mm3, {parts} piece(s): {verdict}")
sys.exit(1 if failed else 0)
