"""Writes body.stl, the dragon's body: one closed surface round a curved spine, in mm, the head towards +z and the back towards +y.

python3 body.py
"""

import math
import struct
from pathlib import Path

# Along the spine: z, y, half width, half height, and how far the crest stands out.
SPINE = [
    (-92, 6, 0.7, 0.7, 0.0),
    (-80, 1, 1.6, 1.7, 0.8),
    (-62, -6, 3.2, 3.6, 1.6),
    (-42, -9, 5.6, 7.5, 2.4),
    (-20, -7, 8.6, 13.0, 3.0),
    (2, -4, 9.6, 16.5, 3.4),
    (24, 1, 7.6, 12.5, 3.2),
    (38, 13, 5.0, 7.0, 2.6),
    (49, 27, 4.2, 5.0, 2.2),
    (58, 38, 4.6, 5.2, 1.8),
    (68, 43, 6.2, 6.0, 1.0),
    (78, 42, 5.4, 4.6, 0.2),
    (90, 38, 3.6, 2.8, 0.0),
    (99, 36, 3.1, 2.3, 0.0),
    (103, 35.4, 1.4, 1.1, 0.0),
]
RINGS = 96
AROUND = 28
# Scales of the crest, from tail to head.
SCALES = 19


def spline(x):
    """The spine at x from 0 to 1, through its points with continuous slopes (Catmull and Rom)."""
    x *= len(SPINE) - 1
    i = min(int(x), len(SPINE) - 2)
    u = x - i
    p = [SPINE[min(max(i + k, 0), len(SPINE) - 1)] for k in (-1, 0, 1, 2)]
    weights = (-u + 2 * u**2 - u**3, 2 - 5 * u**2 + 3 * u**3, u + 4 * u**2 - 3 * u**3, u**3 - u**2)
    return [sum(w * q[k] for w, q in zip(weights, p)) / 2 for k in range(5)]


def ring(i):
    x = i / (RINGS - 1)
    z, y, wide, high, crest = spline(x)
    after, before = spline(min(x + 1e-3, 1)), spline(max(x - 1e-3, 0))
    along = math.atan2(after[1] - before[1], after[0] - before[0])
    tooth = crest * (0.25 + 0.75 * abs(math.sin(math.pi * SCALES * x)))
    points = []
    for k in range(AROUND):
        turn = 2 * math.pi * k / AROUND
        side, up = wide * math.cos(turn), high * math.sin(turn)
        # The crest is a narrow ridge on the back, the belly is flatter than the back is round.
        up += tooth * max(0.0, math.sin(turn)) ** 12
        up *= 0.9 if up < 0 else 1.0
        points.append((side, y + up * math.cos(along), z - up * math.sin(along)))
    return points


def main():
    rings = [ring(i) for i in range(RINGS)]
    middle = [tuple(sum(p[k] for p in r) / AROUND for k in range(3)) for r in (rings[0], rings[-1])]
    triangles = []
    for k in range(AROUND):
        n = (k + 1) % AROUND
        triangles.append((middle[0], rings[0][n], rings[0][k]))
        triangles.append((middle[1], rings[-1][k], rings[-1][n]))
        for a, b in zip(rings, rings[1:]):
            triangles += [(a[k], a[n], b[n]), (a[k], b[n], b[k])]
    with open(Path(__file__).with_name("body.stl"), "wb") as out:
        out.write(b"A dragon's body".ljust(80) + struct.pack("<I", len(triangles)))
        for corners in triangles:
            out.write(struct.pack("<12fH", 0, 0, 0, *(x for p in corners for x in p), 0))


main()
