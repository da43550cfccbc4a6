"""A scene drawn before it runs: plane sections with regions, bodies, particles and gauges, and a view in 3D."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from distfsi.errors import InputError
from distfsi.output.picture import STYLE
from distfsi.output.scales import scaled

WIDTH, HIGHEST = 9.0, 8.0  # of a picture; of one section [inches]
RESOLUTION = 110  # dots per inch
REGION_COLORS = ("#eef3f8", "#f6c89f", "#b7dcb4", "#d4c4e8", "#f2e29b", "#bfe3e6")
BODY_COLORS = ("#1f4e79", "#a23b2a", "#3d7a3a", "#6b4a9b", "#8a6d1c", "#2c7d83")
VIEW = (1200, 900)  # pixels


@dataclass(frozen=True)
class Section:
    """A plane through a scene.

    axes     names of the horizontal and, but in one dimension, the vertical one
    extent   left, right, bottom, top [m]
    label    where the plane lies, in words
    region   (rows, columns) number of the region at each point; None without a fluid
    bodies   by name the signed distance [m] (rows, columns) to its surface
    particles  by name those in the plane (n, 2) [m]
    gauges   by name (n, 2) [m]
    """

    axes: tuple[str, ...]
    extent: tuple[float, float, float, float]
    label: str
    region: np.ndarray | None
    bodies: Mapping[str, np.ndarray]
    particles: Mapping[str, np.ndarray]
    gauges: Mapping[str, np.ndarray]


def draw_sections(path: Path, title: str, sections: Sequence[Section], regions: Sequence[str]) -> Path:
    """Draw sections one below the other; `regions` are what the numbers of the regions mean."""
    with matplotlib.rc_context(STYLE):
        heights = [min(HIGHEST, (WIDTH - 2.0) * _aspect(section)) + 0.9 for section in sections]
        figure = Figure(figsize=(WIDTH, sum(heights) + 1.0), layout="constrained")
        grid = figure.subplots(len(sections), 1, squeeze=False, gridspec_kw={"height_ratios": heights})[:, 0]
        for axes, section in zip(grid, sections, strict=True):
            _draw(axes, section, len(regions))
        names = list(sections[0].bodies)
        patches = [Patch(facecolor=_color(REGION_COLORS, n), edgecolor="0.6", label=r) for n, r in enumerate(regions)]
        patches += [Patch(color=_color(BODY_COLORS, n), label=name) for n, name in enumerate(names)]
        figure.legend(handles=patches, loc="outside lower center", ncols=4, frameon=False)
        figure.suptitle(title)
        figure.savefig(path, dpi=RESOLUTION)
    return path


def _aspect(section: Section) -> float:
    left, right, bottom, top = section.extent
    return (top - bottom) / (right - left)


def _color(colors: Sequence[str], number: int) -> str:
    return colors[number % len(colors)]


def _draw(axes: Axes, section: Section, regions: int) -> None:
    left, right, bottom, top = section.extent
    length, metres = scaled("m", max(right - left, top - bottom))
    extent = (left / length, right / length, bottom / length, top / length)
    if section.region is not None:
        colors = ListedColormap([_color(REGION_COLORS, n) for n in range(regions)])
        picture = axes.imshow(section.region, cmap=colors, origin="lower", extent=extent, interpolation="nearest")
        picture.set_clim(-0.5, regions - 0.5)
    for number, (name, signed) in enumerate(section.bodies.items()):
        color = _color(BODY_COLORS, number)
        rows, columns = signed.shape
        x = (np.arange(columns) + 0.5) / columns * (extent[1] - extent[0]) + extent[0]
        y = (np.arange(rows) + 0.5) / rows * (extent[3] - extent[2]) + extent[2]
        if min(signed.shape) > 1 and signed.min() < 0.0 < signed.max():
            axes.contour(x, y, signed, levels=[0.0], colors=color, linewidths=1.0)
        points = section.particles[name] / length
        axes.plot(*points.T, ".", color=color, markersize=max(0.5, min(4.0, 200.0 / max(len(points), 1) ** 0.5)))
    for name, points in section.gauges.items():
        axes.plot(*(points / length).T, "k+", markersize=8)
        axes.annotate(name, points[0] / length, xytext=(3, 3), textcoords="offset points", fontsize="x-small")
    axes.set(xlim=extent[:2], ylim=extent[2:], title=section.label, aspect="equal")
    axes.set_xlabel(f"{section.axes[0]} [{metres}]")
    if len(section.axes) > 1:
        axes.set_ylabel(f"{section.axes[1]} [{metres}]")
    else:
        axes.set_yticks([])


def draw_view(
    path: Path,
    corners: tuple[Sequence[float], Sequence[float]],
    particles: Mapping[str, tuple[np.ndarray, float]],
    regions: Sequence[tuple[int, np.ndarray]],
) -> Path:
    """Draw a scene in 3D without a screen: its domain as a frame, bodies by their `particles` (n, 3) [m] with their
    spacing, the surfaces of regions by their number and the signed distances [m] of points of a grid (z, y, x). Raises
    InputError without vtk."""
    try:
        import vtk
        from vtk.util.numpy_support import numpy_to_vtk
    except ImportError as error:
        raise InputError(["a view in 3D needs the package vtk, which is not installed"]) from error
    vtk.vtkLogger.SetStderrVerbosity(vtk.vtkLogger.VERBOSITY_OFF)  # that there is no screen
    lower, upper = map(np.asarray, corners)
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1.0, 1.0, 1.0)

    def show(source: Any, color: str, opacity: float = 1.0) -> None:
        mapper = vtk.vtkPolyDataMapper()
        mapper.SetInputConnection(source.GetOutputPort())
        mapper.ScalarVisibilityOff()
        actor = vtk.vtkActor()
        actor.SetMapper(mapper)
        actor.GetProperty().SetColor(*(int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)))
        actor.GetProperty().SetOpacity(opacity)
        renderer.AddActor(actor)

    frame = vtk.vtkCubeSource()
    frame.SetBounds(*np.stack([lower, upper], axis=1).ravel())
    edges = vtk.vtkExtractEdges()
    edges.SetInputConnection(frame.GetOutputPort())
    show(edges, "#555555")
    for number, (points, spacing) in enumerate(particles.values()):
        data, container = vtk.vtkPolyData(), vtk.vtkPoints()
        container.SetData(numpy_to_vtk(np.ascontiguousarray(points), deep=True))
        data.SetPoints(container)
        ball = vtk.vtkSphereSource()
        ball.SetRadius(0.55 * spacing)
        ball.SetThetaResolution(8)
        ball.SetPhiResolution(6)
        glyphs = vtk.vtkGlyph3D()
        glyphs.SetInputData(data)
        glyphs.SetSourceConnection(ball.GetOutputPort())
        glyphs.ScalingOff()
        show(glyphs, _color(BODY_COLORS, number))
    for number, signed in regions:
        image = vtk.vtkImageData()
        image.SetDimensions(*reversed(signed.shape))
        spacing = (upper - lower) / (np.array(signed.shape[::-1]) - 1)
        image.SetOrigin(*lower)
        image.SetSpacing(*spacing)
        image.GetPointData().SetScalars(numpy_to_vtk(signed.ravel(), deep=True))
        surface = vtk.vtkFlyingEdges3D()
        surface.SetInputData(image)
        surface.SetValue(0, 0.0)
        show(surface, _color(REGION_COLORS, number), 0.35)
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(*VIEW)
    window.AddRenderer(renderer)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(*(0.5 * (lower + upper) + np.array([1.4, -1.8, 1.0]) * np.max(upper - lower)))
    camera.SetFocalPoint(*(0.5 * (lower + upper)))
    camera.SetViewUp(0.0, 0.0, 1.0)
    renderer.ResetCamera()
    window.Render()
    grabbed = vtk.vtkWindowToImageFilter()
    grabbed.SetInput(window)
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(str(path))
    writer.SetInputConnection(grabbed.GetOutputPort())
    writer.Write()
    return path
