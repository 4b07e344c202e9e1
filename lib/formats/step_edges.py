"""Polylines along edges, fine enough in space and in the (u, v) of every face beside them."""

import numpy as np

IN_SPACE = 1e-5  # of the largest side of the edge's bounding box: how far its chords may leave it
IN_UV = 1e-4  # of the face's (u, v) box, each way
PARTS = 4  # of each smooth piece to begin with, so that no bend hides between the ends
MOST = 513


def sampled(values, breaks, scales):
    """Parameters t (k,) along an edge, ends included; 2 where everything is straight.

    values : function of t (m,), gives (m, d): the edge's point, then its (u, v) in each face beside it
    breaks : ascending parameters between which the edge is smooth, ends included
    scales : (d - 3,) sizes of the (u, v) boxes of those faces, [u, v, u, v ...]
    """
    parts = max(1, min(PARTS, (MOST - 1) // (len(breaks) - 1)))
    steps = np.arange(parts) / parts
    t = np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * steps).ravel(), breaks[-1])
    x = values(t)
    size = np.ptp(x[:, :3], axis=0).max()
    scale = np.concatenate([np.full(3, IN_SPACE * (size or 1.0)), IN_UV * np.asarray(scales)])
    left = np.arange(len(t) - 1)
    while left.size and len(t) < MOST:
        # Halve those intervals whose middle is off their chord; of these, look at both halves again
        middle = (t[left] + t[left + 1]) / 2
        new = values(middle)
        bad = _off(new / scale, x[left] / scale, x[left + 1] / scale) > 1.0
        at = left[bad] + 1
        t, x = np.insert(t, at, middle[bad]), np.insert(x, at, new[bad], axis=0)
        first = at - 1 + np.arange(at.size)
        left = np.stack([first, first + 1], axis=1).ravel()
    whole = _off(x / scale, x[:1] / scale, x[-1:] / scale)
    return t[[0, -1]] if whole.max() <= 1.0 and size > 0 else t


def _off(p, a, b):
    """Largest distance of points p (m, d) from segments a-b, over the space block and each (u, v) block."""
    worst = np.zeros(len(p))
    for block in [slice(0, 3), *(slice(k, k + 2) for k in range(3, p.shape[1], 2))]:
        along, r = (b - a)[:, block], p[:, block] - a[:, block]
        length = np.einsum("kc,kc->k", along, along)
        s = np.clip(np.einsum("kc,kc->k", along, r) / np.where(length > 0, length, 1.0), 0.0, 1.0)
        worst = np.maximum(worst, np.linalg.norm(r - s[:, None] * along, axis=1))
    return worst
