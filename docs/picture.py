"""picture.py OUT.png PART.stl ...: draws printed parts, one colour each, seen obliquely. Needs the Python packages vtk
and pillow; docs/chebyshev.png is made of the example's parts by

    python docs/picture.py docs/chebyshev.png out/chebyshev_lambda_*.stl
"""

import itertools
import os
import sys
import tempfile

import vtk
from PIL import Image

COLOURS = [(0.55, 0.72, 0.88), (0.96, 0.62, 0.25), (0.50, 0.70, 0.45), (0.70, 0.55, 0.75)]
VIEW_FROM = (0.55, -0.80, 1.15)
UP = (0.0, 1.0, 0.25)
WIDTH, HEIGHT = 1200, 1000
# Drawn larger, then reduced: smooth edges whatever the renderer can do.
OVERSAMPLING = 2
# Beyond what shows the parts' sphere, as far as their box stays inside the picture.
LARGEST_ZOOM = 1.2
WITHIN = 0.97


def reach(renderer):
    """How far the box of all parts reaches from the middle of the picture; 1 is its edge."""
    bounds = renderer.ComputeVisiblePropBounds()
    far = 0.0
    for corner in itertools.product(bounds[0:2], bounds[2:4], bounds[4:6]):
        renderer.SetWorldPoint(*corner, 1.0)
        renderer.WorldToView()
        far = max(far, *(abs(v) for v in renderer.GetViewPoint()[:2]))
    return far


def draw(parts, out):
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(0.97, 0.97, 0.96)
    for i, part in enumerate(parts):
        reader = vtk.vtkSTLReader()
        reader.SetFileName(part)
        normals = vtk.vtkPolyDataNormals()
        normals.SetInputConnection(reader.GetOutputPort())
        normals.SetFeatureAngle(25)
        normals.SplittingOn()
        mapper = vtk.vtkPolyDataMapper()
        mapper.SetInputConnection(normals.GetOutputPort())
        mapper.ScalarVisibilityOff()
        actor = vtk.vtkActor()
        actor.SetMapper(mapper)
        shade = actor.GetProperty()
        shade.SetColor(*COLOURS[i % len(COLOURS)])
        shade.SetAmbient(0.25)
        shade.SetDiffuse(0.85)
        shade.SetSpecular(0.15)
        shade.SetSpecularPower(25)
        renderer.AddActor(actor)
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(WIDTH * OVERSAMPLING, HEIGHT * OVERSAMPLING)
    window.SetMultiSamples(0)
    window.AddRenderer(renderer)
    camera = renderer.GetActiveCamera()
    renderer.ResetCamera()
    focus = camera.GetFocalPoint()
    camera.SetPosition(*(f + 300 * v for f, v in zip(focus, VIEW_FROM)))
    camera.SetViewUp(*UP)
    camera.SetViewAngle(18)
    renderer.ResetCamera()
    camera.Zoom(min(LARGEST_ZOOM, WITHIN / reach(renderer)))
    window.Render()
    grab = vtk.vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    with tempfile.TemporaryDirectory() as folder:
        large = os.path.join(folder, "large.png")
        writer = vtk.vtkPNGWriter()
        writer.SetFileName(large)
        writer.SetInputConnection(grab.GetOutputPort())
        writer.Write()
        image = Image.open(large).convert("RGB").resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)
    image.quantize(128, dither=Image.Dither.NONE).save(out, optimize=True)


draw(sys.argv[2:], sys.argv[1])
