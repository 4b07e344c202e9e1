"""How large a scene must appear on the screen for each level of detail.

A level serves as long as its largest distance stays below a pixel.  With the bounding box filling a share f of the
screen's height (coverage f^2), a distance d is f d / size of that height.
"""

import numpy as np

PIXELS = 1080  # height of the screen a level is chosen for
SMALLEST = 1e-6  # coverage at which the coarsest level goes


def screen_coverage(distance, size):
    """Smallest coverage (k,) in [0, 1] of each level, finest first: there the next one's error is a pixel.

    distance : (k,) largest distance of each level to the exact surfaces;  size : largest side of the bounding box
    """
    distance = np.maximum.accumulate(np.asarray(distance, dtype=np.float64))
    share = size / np.maximum(PIXELS * distance[1:], 1e-300)
    return np.append(np.minimum(share, 1.0) ** 2, 0.0).clip(SMALLEST if len(distance) > 1 else 0.0, 1.0)
