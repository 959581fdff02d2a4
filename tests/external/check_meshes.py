"""check_meshes.py PART.stl ...: independent opinions on each mesh: trimesh's, the Manifold kernel's, CGAL's exact one."""

import os
import sys
import tempfile

import manifold3d
import numpy
import trimesh
from CGAL import CGAL_Polygon_mesh_processing
from CGAL.CGAL_Polyhedron_3 import Polyhedron_3


def self_intersects(mesh):
    """Whether faces cut each other, by exact arithmetic (a test in floats flags coplanar neighbours)."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "part.off")
        # Twelve digits tell any two single-precision numbers apart.
        mesh.export(path, digits=12)
        solid = Polyhedron_3(path)
        if not solid.is_closed() or solid.size_of_facets() != len(mesh.faces):
            return True
        return CGAL_Polygon_mesh_processing.does_self_intersect(solid)


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
        "free of self-intersections": not self_intersects(mesh),
    }
    parts = mesh.body_count
    checks["one piece"] = parts == 1
    bad = [name for name, holds in checks.items() if not holds]
    failed = failed or bool(bad)
    verdict = "FAIL: not " + ", not ".join(bad) if bad else "ok"
    print(f"{path}: {len(mesh.faces)} triangles, {mesh.volume:.1f} mm3, {parts} piece(s): {verdict}")
sys.exit(1 if failed else 0)
