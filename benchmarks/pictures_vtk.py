"""The scenes of the picture benchmark drawn by VTK; needs only numpy and vtk, not katana450.

    python -m benchmarks.pictures_vtk SCENE OUT.png COUNT

Prints a JSON object; see `measured`.
"""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path
from typing import Any

started = time.perf_counter()
import numpy as np  # noqa: E402
import vtk  # noqa: E402
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy  # noqa: E402

from benchmarks.pictures_scene import PictureScene, measured  # noqa: E402

IMPORT_SECONDS = time.perf_counter() - started

FLOOR_EXTENT = 3.0
"""[m] Half the side of the floor and length of its lines."""

LINES = ((0.05, 0.0008), (0.25, 0.0014))
"""[m] Distance and width of the fine and the coarse lines of the floor."""

SHADOW_MAP = 2048
"""[px] Side of the map of each lamp's shadows."""


def window(scene: PictureScene) -> Any:
    """Return an off-screen window with the scene, its lamps, shadows and translucent water."""
    shown = vtk.vtkRenderWindow()
    shown.SetOffScreenRendering(1)
    shown.SetMultiSamples(0)
    shown.SetAlphaBitPlanes(1)
    shown.SetSize(int(scene.size[0]), int(scene.size[1]))
    renderer = vtk.vtkRenderer()
    shown.AddRenderer(renderer)
    floor, sky = scene.room[0] / 255.0, scene.room[1] / 255.0
    renderer.GradientBackgroundOn()
    renderer.SetBackground(*floor)
    renderer.SetBackground2(*sky)
    renderer.SetPass(_passes())
    camera = renderer.GetActiveCamera()
    camera.SetPosition(*scene.camera[0])
    camera.SetFocalPoint(*scene.camera[1])
    camera.SetViewUp(0.0, 0.0, 1.0)
    camera.SetViewAngle(math.degrees(float(scene.fov[0])))
    for number, (towards, colour) in enumerate(scene.lamps):
        renderer.AddLight(_lamp(towards, colour, casts=number == 0))
    for number in range(len(scene.colour)):
        renderer.AddActor(_item(scene, number))
    for actor in _floor(scene):
        renderer.AddActor(actor)
    sky_image = _environment(sky, floor)
    renderer.UseImageBasedLightingOn()
    renderer.SetEnvironmentTexture(sky_image)
    renderer.SetEnvironmentUp(0.0, 0.0, 1.0)
    renderer.SetEnvironmentRight(1.0, 0.0, 0.0)
    renderer.ResetCameraClippingRange()
    return shown


def _passes() -> Any:
    """Return shadows, then translucent surfaces by depth peeling, at four samples per pixel."""
    baker, opaque = vtk.vtkShadowMapBakerPass(), vtk.vtkShadowMapPass()
    baker.SetResolution(SHADOW_MAP)
    opaque.SetShadowMapBakerPass(baker)
    peeling = vtk.vtkDepthPeelingPass()
    peeling.SetTranslucentPass(vtk.vtkTranslucentPass())
    every = vtk.vtkRenderPassCollection()
    for each in (vtk.vtkLightsPass(), baker, opaque, peeling):
        every.AddItem(each)
    sequence, camera, smooth = vtk.vtkSequencePass(), vtk.vtkCameraPass(), vtk.vtkSSAAPass()
    sequence.SetPasses(every)
    camera.SetDelegatePass(sequence)
    smooth.SetDelegatePass(camera)
    return smooth


def _lamp(towards: Any, colour: Any, *, casts: bool) -> Any:
    light = vtk.vtkLight()
    light.SetLightTypeToSceneLight()
    light.SetPosition(*(3.0 * towards))
    light.SetFocalPoint(0.0, 0.0, 0.0)
    light.SetColor(*colour)
    # VTK draws shadows only of spot lights.
    light.SetPositional(casts)
    if casts:
        light.SetConeAngle(22.0)
    return light


def _poly(vertices: Any, faces: Any, normals: Any) -> Any:
    points = vtk.vtkPoints()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(vertices), deep=True))
    cells = vtk.vtkCellArray()
    cells.SetData(3, numpy_to_vtkIdTypeArray(faces.astype(np.int64).ravel(), deep=True))
    poly = vtk.vtkPolyData()
    poly.SetPoints(points)
    poly.SetPolys(cells)
    given = numpy_to_vtk(np.ascontiguousarray(normals), deep=True)
    given.SetName("Normals")
    poly.GetPointData().SetNormals(given)
    return poly


def _actor(poly: Any) -> Any:
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(poly)
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    return actor


def _item(scene: PictureScene, number: int) -> Any:
    used, faces = np.unique(scene.faces[scene.item == number], return_inverse=True)
    actor = _actor(_poly(scene.vertices[used], faces.reshape(-1, 3), scene.normals[used]))
    shown = actor.GetProperty()
    shown.SetInterpolationToPBR()
    shown.SetColor(*scene.colour[number])
    shown.SetMetallic(float(scene.metallic[number]))
    shown.SetRoughness(float(scene.rough[number]))
    shown.SetOpacity(float(scene.opacity[number]))
    return actor


def _floor(scene: PictureScene) -> list[Any]:
    height, far = float(scene.floor[0]), FLOOR_EXTENT
    found = [_rectangles(np.array([(-far, -far, far, far)]), height, scene.room[0])]
    for number, (apart, wide) in enumerate(LINES):
        at = np.arange(-far, far + 0.5 * apart, apart)
        low, high, end = at - 0.5 * wide, at + 0.5 * wide, np.full(len(at), far)
        along = np.stack((low, -end, high, end), axis=1)
        across = along[:, (1, 0, 3, 2)]
        # Ribbons, because VTK's shader for lines does not compile together with shadows.
        level = height + 2e-4 * (1 + number)
        found.append(_rectangles(np.concatenate((along, across)), level, scene.room[2 + number]))
    return found


def _rectangles(sides: Any, height: float, rgb: Any) -> Any:
    """Return level rectangles, one for each row x, y, x, y of opposite corners in ``sides``."""
    count = len(sides)
    x, y = sides[:, (0, 2, 2, 0)], sides[:, (1, 1, 3, 3)]
    corners = np.stack((x, y, np.full_like(x, height)), axis=2).reshape(-1, 3)
    faces = (4 * np.arange(count)[:, None, None] + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3)
    actor = _actor(_poly(corners, faces, np.tile((0.0, 0.0, 1.0), (4 * count, 1))))
    actor.GetProperty().SetColor(*(rgb / 255.0))
    actor.GetProperty().SetAmbient(0.35)
    return actor


def _environment(sky: Any, floor: Any) -> Any:
    """Return a panorama from the floor's colour below to the sky's above, for reflections."""
    fraction = np.linspace(0.0, 1.0, 64)[:, None, None]
    picture = np.tile(floor + fraction * (sky - floor), (1, 128, 1))
    pixels = numpy_to_vtk((255.0 * picture).astype(np.uint8).reshape(-1, 3), deep=True)
    image = vtk.vtkImageData()
    image.SetDimensions(128, 64, 1)
    image.GetPointData().SetScalars(pixels)
    texture = vtk.vtkTexture()
    texture.SetInputData(image)
    texture.MipmapOn()
    texture.InterpolateOn()
    texture.UseSRGBColorSpaceOn()
    return texture


def pixels_of(shown: Any) -> Any:
    """Return the pixels (height, width, 3) of ``shown``, top row first."""
    grabber = vtk.vtkWindowToImageFilter()
    grabber.SetInput(shown)
    grabber.ReadFrontBufferOff()
    grabber.Update()
    image = grabber.GetOutput()
    width, height, _ = image.GetDimensions()
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, 3)[::-1]


def main() -> None:
    """Draw the picture as often as requested, each time from the triangles."""
    scene = PictureScene.load(Path(sys.argv[1]))

    def draw() -> Any:
        shown = window(scene)
        shown.Render()
        return np.ascontiguousarray(pixels_of(shown))

    measurements = measured(draw, int(sys.argv[3]), IMPORT_SECONDS, ["vtk"])
    pixels = draw()
    height, width, _ = pixels.shape
    image = vtk.vtkImageData()
    image.SetDimensions(width, height, 1)
    image.GetPointData().SetScalars(numpy_to_vtk(pixels[::-1].reshape(-1, 3), deep=True))
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(sys.argv[2])
    writer.SetInputData(image)
    writer.Write()
    print(measurements)


if __name__ == "__main__":
    main()
