"""Sections of OpenSees as fibres."""

from __future__ import annotations

import math
from typing import Any

from .materials import Unfit

Fibre = tuple[float, float, float, Any]  # y, z, area, tag of the material
Point = tuple[float, float]


def cell(corners: list[Point]) -> tuple[float, float, float]:
    """Centre and area of a polygon."""
    area = y = z = 0.0
    for (a, b), (c, d) in zip(corners, corners[1:] + corners[:1]):
        cross = a * d - c * b
        area += cross / 2
        y += (a + c) * cross / 6
        z += (b + d) * cross / 6
    if area == 0:
        raise Unfit("has a patch without area")
    return y / area, z / area, abs(area)


def fibres(args: list[Any], name: str) -> list[Fibre]:
    """Fibres of a command `fiber`, `patch` or `layer`."""
    if name == "fiber":
        y, z, area, material = args[:4]
        return [(float(y), float(z), float(area), material)]
    kind, material, *rest = args
    numbers = [float(value) for value in rest if not isinstance(value, str)]
    if name == "patch" and kind in ("rect", "quad", "quadr", "quadrilateral", "rectangular"):
        first, second = int(numbers[0]), int(numbers[1])
        at = numbers[2:]
        if len(at) == 4:
            at = [at[0], at[1], at[2], at[1], at[2], at[3], at[0], at[3]]
        corners = [(at[i], at[i + 1]) for i in range(0, 8, 2)]

        def inside(u: float, v: float) -> Point:
            shares = ((1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v)
            return sum(s * c[0] for s, c in zip(shares, corners)), sum(s * c[1] for s, c in zip(shares, corners))

        made = []
        for i in range(first):
            for j in range(second):
                edge = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
                made.append((*cell([inside(u / first, v / second) for u, v in edge]), material))
        return made
    if name == "patch" and kind in ("circ", "circular"):
        around, radial = int(numbers[0]), int(numbers[1])
        yc, zc, inner, outer = numbers[2:6]
        begin, end = (numbers[6:8] + [0.0, 360.0])[:2] if len(numbers) >= 8 else (0.0, 360.0)
        made = []
        for ring in range(radial):
            radii = [inner + (outer - inner) * (ring + k) / radial for k in (0, 1)]
            for part in range(around):
                angle = math.radians(begin + (end - begin) * (part + 0.5) / around)
                half = math.radians((end - begin) / around) / 2
                area = half * (radii[1] ** 2 - radii[0] ** 2)
                radius = 2 / 3 * math.sin(half) / half * (radii[1] ** 3 - radii[0] ** 3) / (radii[1] ** 2 - radii[0] ** 2)
                made.append((yc + radius * math.cos(angle), zc + radius * math.sin(angle), area, material))
        return made
    if name == "layer" and kind == "straight":
        count, area = int(numbers[0]), numbers[1]
        y1, z1, y2, z2 = numbers[2:6]
        shares = [i / (count - 1) for i in range(count)] if count > 1 else [0.5]
        return [(y1 + (y2 - y1) * s, z1 + (z2 - z1) * s, area, material) for s in shares]
    if name == "layer" and kind in ("circ", "circular"):
        count, area, yc, zc, radius = int(numbers[0]), *numbers[1:5]
        begin, end = numbers[5:7] if len(numbers) >= 7 else (0.0, 360.0 - 360.0 / count)
        shares = [i / (count - 1) for i in range(count)] if count > 1 else [0.0]
        angles = [math.radians(begin + (end - begin) * share) for share in shares]
        return [(yc + radius * math.cos(a), zc + radius * math.sin(a), area, material) for a in angles]
    raise Unfit(f"has a {name} of the kind {kind}, which has no counterpart")


def centred(given: list[Fibre], in_space: bool) -> list[Fibre]:
    """Fibres about their centre of area, as OpenSees takes them. In a plane those of one height become one."""
    whole = sum(area for _, _, area, _ in given)
    centre = [sum(fibre[k] * fibre[2] for fibre in given) / whole for k in (0, 1)]
    if in_space:
        return [(y - centre[0], z - centre[1], area, material) for y, z, area, material in given]
    size = max(abs(y) for y, *_ in given) or 1.0
    merged: dict[Any, Fibre] = {}
    for y, _, area, material in given:
        key = (round(y / size * 1e9), material)
        y0, _, known, _ = merged.get(key, (y - centre[0], 0.0, 0.0, material))
        merged[key] = (y0, 0.0, known + area, material)
    return list(merged.values())
