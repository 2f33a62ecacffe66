"""Solids as triangle meshes: cylinders, and hulls of circles with rounded edges."""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

Point = tuple[float, float, float]
Face = tuple[Point, ...]
Circle = tuple[float, float, float]  # centre x, y, and radius

CORNERS = 32  # of a full circle
STRIPS = 2  # of a rounded edge


class Mesh:
    """Convex faces, counter-clockwise seen from outside; lengths in m."""

    def __init__(self, faces: Iterable[Face] = ()) -> None:
        self.faces = list(faces)

    def __add__(self, other: Mesh) -> Mesh:
        return Mesh(self.faces + other.faces)

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
        """Return the mesh shifted."""
        return self._mapped(lambda p: (p[0] + x, p[1] + y, p[2] + z))

    def along_x(self) -> Mesh:
        """Return the mesh turned so that its axes x, y, z are y, z, x."""
        return self._mapped(lambda p: (p[2], p[0], p[1]))

    def along_y(self) -> Mesh:
        """Return the mesh turned so that its axes x, y, z are z, x, y."""
        return self._mapped(lambda p: (p[1], p[2], p[0]))

    def write_stl(self, file: Path) -> None:
        """Write a binary STL file."""
        triangles = [
            (face[0], b, c) for face in self.faces for b, c in itertools.pairwise(face[1:])
        ]
        with file.open("wb") as to:
            to.write(b"rtcf_arm".ljust(80, b"\0") + struct.pack("<I", len(triangles)))
            for a, b, c in triangles:
                to.write(struct.pack("<12fH", *normal(a, b, c), *a, *b, *c, 0))

    def _mapped(self, change: Callable[[Point], Point]) -> Mesh:
        return Mesh(tuple(change(point) for point in face) for face in self.faces)


def cylinder(radius: float, height: float, edge: float = 0.004) -> Mesh:
    """Return a cylinder about the z axis, centred, with rounded edges."""
    return hull([(0.0, 0.0, radius)], height, edge)


def box(x: float, y: float, z: float, edge: float = 0.004) -> Mesh:
    """Return a box of these lengths, centred, with rounded edges."""
    round_ = min(4 * edge, x / 2, y / 2)
    corners = [
        (i * (x / 2 - round_), j * (y / 2 - round_), round_) for i in (-1, 1) for j in (-1, 1)
    ]
    return hull(corners, z, edge)


def hull(circles: Sequence[Circle], height: float, edge: float = 0.004) -> Mesh:
    """Return the hull of cylinders along z of one height, centred in z, with rounded edges.

    circles  of the plane x, y; radii above `edge`
    """
    quarter = [0.5 * math.pi * i / STRIPS for i in range(STRIPS + 1)]
    lower = [(edge * (1 - math.sin(a)), -height / 2 + edge * (1 - math.cos(a))) for a in quarter]
    layers = lower + [(inset, -z) for inset, z in reversed(lower)]
    return _skin([[(x, y, z) for x, y in _outline(circles, inset)] for inset, z in layers])


def _outline(circles: Sequence[Circle], inset: float) -> list[tuple[float, float]]:
    """Return the corners of the circles' hull, counter-clockwise, moved inwards."""
    corners = []
    for i in range(CORNERS):
        u, v = math.cos(2 * math.pi * i / CORNERS), math.sin(2 * math.pi * i / CORNERS)
        # The circle that reaches farthest in this direction.
        x, y, radius = max(circles, key=lambda c: c[0] * u + c[1] * v + c[2])
        corners.append((x + (radius - inset) * u, y + (radius - inset) * v))
    return corners


def _skin(rings: Sequence[Sequence[Point]]) -> Mesh:
    """Join rings of equally many points, upwards, and close both ends."""
    faces: list[Face] = [tuple(reversed(rings[0])), tuple(rings[-1])]
    for low, high in itertools.pairwise(rings):
        for i in range(len(low)):
            j = (i + 1) % len(low)
            faces.append((low[i], low[j], high[j], high[i]))
    return Mesh(faces)


def normal(a: Point, b: Point, c: Point) -> Point:
    """Return the unit normal of a triangle, 0 if it has no area."""
    u = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    v = (c[0] - a[0], c[1] - a[1], c[2] - a[2])
    n = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
    length = math.hypot(*n)
    return (n[0] / length, n[1] / length, n[2] / length) if length > 0.0 else (0.0, 0.0, 0.0)
