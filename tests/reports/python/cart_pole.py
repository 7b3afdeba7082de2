"""A pole balanced on a cart in gusty air: a machine of one's own in thirty lines.

Every 50 ms the cart accelerates against the pole's lean, by no more than it can; a gust pushes the pole for as long.
"""

import numpy as np

import metastable

gravity, length, period, substeps = 9.81, 1.0, 0.05, 5  # m/s^2, m, s
most = 4.0  # of the cart's acceleration [m/s^2]
gust = 6.5  # sd of the acceleration by which a gust pushes the pole [m/s^2]


def step(state, noise):
    """Angle [rad] and rate [rad/s] at the beginning of the next period, and whether the pole fell."""
    angle, rate = state.T
    push = gust * noise[:, 0]
    cart = np.clip(25 * angle + 7 * rate, -most, most)
    for _ in range(substeps):
        rate = rate + period / substeps * (gravity * np.sin(angle) - cart * np.cos(angle) + push) / length
        angle = angle + period / substeps * rate
    return np.column_stack([angle, rate]), np.abs(angle) > 0.8


pole = metastable.walker(step, dimension=2, noise=1, start=[0, 0], names=["angle [rad]", "rate [rad/s]"],
                         noise_names=["gust [sd]"], name="a pole on a cart")

if __name__ == "__main__":
    print(pole.study(how_it_fails=True))
