"""Friedlander's wave."""

from math import exp


def friedlander_integral(decay, share):
    """Of (1 - s) exp(-decay s) over s up to the `share` of the positive phase, but for a constant."""
    return exp(-decay * share) * (share / decay - 1.0 / decay + 1.0 / (decay * decay))
