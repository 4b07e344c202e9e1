"""Tolerances of the tests, each with its reason.  A test that needs another number says why beside it."""

EXACT = 1e-12  # float64 through a few dozen operations on numbers near 1
QUADRATURE = 1e-9  # composite Gauss-Legendre of lib.nurbs.shape on rational quadrics
LIMIT = 1e-6  # a normal at a pole against the limit from inside
FLOAT32 = 2e-6  # sums of a few dozen float32 numbers near 1
STANDARD_ERRORS = 4  # noise: a fair estimate departs further in 1 of 16000 cases
FACETED = 0.02  # a curved emitter is facets within 1 % of its size: its outline errs by twice that in area
COINCIDENT = 1e-4  # leaks allowed: rays aimed exactly at vertices and edges that pass
MOVED = 1e-2  # maps of a scene 1e5 away, whose float64 coordinates have lost 5 of 16 digits before they are centred
SCALED = 1e-3  # maps of a scene of another size: the frame differs in the last digit, float32 rays in a few more
LINEAR = 1e-6  # light scaled by a factor: float32 values, float64 sums
