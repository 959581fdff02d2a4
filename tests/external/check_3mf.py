"""check_3mf.py FILE.3mf...: trimesh opens each archive and finds what its own text promises: millimetres, named objects
that are closed, a material, a thumbnail, and every part on the bed and apart from the others."""

import io
import re
import sys
import zipfile

import numpy as np
import trimesh
from PIL import Image


def check(path):
    archive = zipfile.ZipFile(path)
    assert archive.testzip() is None, f"{path}: a damaged archive"
    assert all(i.date_time[0] == 1980 for i in archive.infolist()), f"{path}: times in the archive"
    text = archive.read("3D/3Dmodel.model").decode()
    assert 'unit="millimeter"' in text, f"{path}: no unit"
    assert re.search(r"<base [^>]*name=", text), f"{path}: no material"
    for name in ("Title", "Application", "Description"):
        assert re.search(f'<metadata [^>]*name="{name}"', text), f"{path}: no {name}"
    names = re.findall(r'<object [^>]*?\bname="([^"]+)"', text)
    numbers = re.findall(r'<(?:object|basematerials) [^>]*?\bid="(\d+)"', text)
    assert len(set(numbers)) == len(numbers) == len(names) + 1, f"{path}: numbers of resources: {numbers}"
    assert "requiredextensions" not in text, f"{path}: needs extensions"
    picture = Image.open(io.BytesIO(archive.read("Metadata/thumbnail.png")))
    assert picture.size[0] >= 256 and len(picture.getcolors(1 << 20)) > 20, f"{path}: an empty thumbnail"
    scene = trimesh.load(path)
    assert set(scene.geometry) == set(names), f"{path}: {set(scene.geometry)} are not {names}"
    boxes = []
    for node in scene.graph.nodes_geometry:
        transform, geometry = scene.graph[node]
        mesh = scene.geometry[geometry].copy()
        mesh.apply_transform(transform)
        assert mesh.is_watertight and mesh.is_winding_consistent, f"{path}: {geometry} is open"
        low, high = mesh.bounds
        assert abs(low[2]) < 1e-4 and (low > -1e-4).all(), f"{path}: {geometry} is not on the bed: {low}"
        for other, (least, most) in boxes:
            assert (low[:2] >= most[:2] - 1e-6).any() or (high[:2] <= least[:2] + 1e-6).any(), f"{geometry} on {other}"
        boxes.append((geometry, (low, high)))
    total = sum(abs(scene.geometry[g].volume) for g in scene.geometry)
    print(f"{path}: {len(names)} objects, {total / 1000:.2f} cm3, thumbnail {picture.size}, {np.round(boxes[0][1][1], 1)}")


if __name__ == "__main__":
    assert len(sys.argv) > 1, "names of archives"
    for path in sys.argv[1:]:
        check(path)
