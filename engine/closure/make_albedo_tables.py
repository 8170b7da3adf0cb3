#!/usr/bin/env python3
"""Writes albedo_tables.cpp: directional albedos of GGX lobes by deterministic integration; albedo.h says of what.

Run by hand when the tables' definition changes: python3 make_albedo_tables.py > albedo_tables.cpp
"""

from __future__ import annotations

import numpy as np

FINE = 32  # cells of the reflection table per axis
COARSE = 16  # cells of the tables that also depend on the index
POINTS = 16384


def points() -> tuple[np.ndarray, np.ndarray]:
    """A rank-1 lattice (the plastic number's): evenly spread, no seed."""
    g = 1.32471795724474602596
    i = np.arange(POINTS) + 0.5
    return (0.5 + i / g) % 1.0, (0.5 + i / (g * g)) % 1.0


def visible_normals(alpha: float, mu: float) -> tuple[np.ndarray, np.ndarray]:
    """Normals of GGX seen from wo = (sin, 0, mu), by spherical caps; and wo."""
    u, v = points()
    wo = np.array([np.sqrt(max(0.0, 1.0 - mu * mu)), 0.0, mu])
    ws = np.array([alpha * wo[0], 0.0, wo[2]])
    ws /= np.linalg.norm(ws)
    z = (1.0 - v) * (1.0 + ws[2]) - ws[2]
    r = np.sqrt(np.maximum(0.0, 1.0 - z * z))
    h = np.stack(
        [alpha * (r * np.cos(2 * np.pi * u) + ws[0]), alpha * r * np.sin(2 * np.pi * u), np.maximum(z + ws[2], 1e-12)],
        1,
    )
    return h / np.linalg.norm(h, axis=1, keepdims=True), wo


def smith(alpha: float, z: np.ndarray) -> np.ndarray:
    """Lambda."""
    z2 = np.maximum(z * z, 1e-12)
    return 0.5 * (np.sqrt(1.0 + alpha * alpha * (1.0 - z2) / z2) - 1.0)


def fresnel(c: np.ndarray, eta: float) -> np.ndarray:
    g2 = eta * eta - 1.0 + c * c
    g = np.sqrt(np.maximum(g2, 1e-12))
    a = (g - c) / (g + c)
    b = (c * (g + c) - 1.0) / (c * (g - c) + 1.0)
    return np.where(g2 > 0.0, 0.5 * a * a * (1.0 + b * b), 1.0)


def directional(rough: float, mu: float, etas: list[float]) -> tuple[float, list[float], list[float]]:
    """Albedo of reflection without Fresnel; per eta: mean position on the Fresnel curve, and albedo of glass."""
    alpha, mu = max(rough * rough, 1e-6), max(mu, 1e-5)
    h, wo = visible_normals(alpha, mu)
    co = h @ wo
    wr_z = 2.0 * co * h[:, 2] - wo[2]
    lo = smith(alpha, np.array(mu))
    reflect = np.where(wr_z > 0.0, (1.0 + lo) / (1.0 + lo + smith(alpha, wr_z)), 0.0)
    positions, glasses = [], []
    for eta in etas:
        f = fresnel(co, eta)
        f0 = ((eta - 1.0) / (eta + 1.0)) ** 2
        position = np.clip((f - f0) / max(1.0 - f0, 1e-6), 0.0, 1.0)
        cos_t = np.sqrt(np.maximum(0.0, 1.0 - (1.0 - co * co) / (eta * eta)))
        wt_z = h[:, 2] * (co / eta - cos_t) - wo[2] / eta
        # Light that facets bend back to the side it came from is lost; Cycles' table counts it all the same.
        refract = (1.0 + lo) / (1.0 + lo + smith(alpha, wt_z))
        positions.append(float(np.mean((wr_z > 0.0) * position)))
        glasses.append(float(np.mean(reflect * f + refract * (1.0 - f))))
    return float(np.mean(reflect)), positions, glasses


def eta_of(x: float) -> float:
    """Index of node x of the index axis: x = sqrt((n - 1) / (n + 1))."""
    s = min(max(x * x, 1e-5), 0.998)
    return (1.0 + s) / (1.0 - s)


def average(albedo: np.ndarray) -> np.ndarray:
    """2 integral E(mu) mu dmu over the last axis, E linear between nodes."""
    mu = np.linspace(0.0, 1.0, albedo.shape[-1])
    fine = (np.arange(4096) + 0.5) / 4096
    values = np.apply_along_axis(lambda e: np.interp(fine, mu, e), -1, albedo)
    return np.mean(values * 2.0 * fine, -1)


def write(name: str, values: np.ndarray) -> None:
    print(f"const float {name}[{values.size}] = {{")
    flat = [f"{v:.4f}".replace("0.", ".") if v < 1 else "1" for v in values.ravel()]
    for i in range(0, len(flat), 32):
        print("    " + ", ".join(f"{v}f" if "." in v else v for v in flat[i : i + 32]) + ",")
    print("};")


def main() -> None:
    reflection = np.array(
        [[directional(r, mu, [])[0] for mu in np.linspace(0, 1, FINE)] for r in np.linspace(0, 1, FINE)]
    )
    axis = np.linspace(0, 1, COARSE)
    etas = [eta_of(x) for x in axis]
    shape = (COARSE, COARSE, COARSE)
    position, outside, inside = np.empty(shape), np.empty(shape), np.empty(shape)
    for i, r in enumerate(axis):
        for j, mu in enumerate(axis):
            _, p, g = directional(r, mu, etas + [1.0 / e for e in etas])
            position[:, i, j], outside[:, i, j], inside[:, i, j] = p[:COARSE], g[:COARSE], g[COARSE:]
    print("// Made by make_albedo_tables.py: change that, not this.\n// clang-format off")
    print('#include "closure/albedo.h"\n\nnamespace talbot {\n')
    write("kGgxAlbedo", reflection)
    write("kGgxAverage", average(reflection))
    write("kFresnelPosition", position)
    write("kGlassAlbedo", np.stack([outside, inside]))
    write("kGlassAverage", np.stack([average(outside), average(inside)]))
    print("\n}  // namespace talbot")


if __name__ == "__main__":
    main()
