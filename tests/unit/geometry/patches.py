import numpy as np

from cccd.geometry.bsplines import Patch, basis, closed_knots, open_knots, smoothing_operator


def cylinder(radius=10.0, height=30.0, around=24, along=6) -> Patch:
    """A tube whose closed splines are fitted to a circle."""
    u = np.arange(400) / 400
    knots_u, knots_v = closed_knots(around), open_knots(along, height)
    circle = radius * np.column_stack([np.cos(2 * np.pi * u), np.sin(2 * np.pi * u)])
    ring = smoothing_operator(basis(u, knots_u, 3, True), 0.0, True) @ circle
    z = np.array([knots_v[n + 1 : n + 4].mean() for n in range(along)])
    net = np.empty((around, along, 3))
    net[..., :2], net[..., 2] = ring[:, None], z
    return Patch(net, np.ones((around, along)), knots_u, knots_v, 3, 3, True, False, 1)


def random_parameters(patch, count=50):
    rng = np.random.default_rng(1)
    return rng.random(count), rng.random(count) * patch.knots_v[-1]
