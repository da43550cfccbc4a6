"""Units, scales and labels of what is drawn."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.colors import LogNorm, Normalize

PREFIXES = {1e9: "G", 1e6: "M", 1e3: "k", 1.0: "", 1e-3: "m", 1e-6: "µ", 1e-9: "n"}
UPWARDS = ("Pa", "Pa s", "J", "J/m", "J/m2", "J/kg", "N", "N/m", "N/m2", "N s", "N s/m", "N s/m2")  # take k, M, G
DECADES = 100.0  # positive values whose largest and smallest differ by more get a logarithmic scale


def scaled(unit: str, largest: float) -> tuple[float, str]:
    """The decimal multiple of a unit that suits values up to `largest`: (1e6, "MPa"). Only m and s, and the units
    UPWARDS, take one."""
    if unit not in ("m", "s", *UPWARDS):
        return 1.0, unit
    size = next((size for size in PREFIXES if largest >= 0.9999 * size), 1.0)
    size = max(size, 1.0) if unit in UPWARDS else size
    return size, PREFIXES[size] + unit


def largest(arrays: Iterable[np.ndarray]) -> float:
    """The largest finite magnitude in any of the arrays, 0 if there is none."""
    return max((float(np.abs(a[np.isfinite(a)]).max(initial=0.0)) for a in arrays), default=0.0)


def norm_of(arrays: Sequence[np.ndarray]) -> Normalize:
    values = np.concatenate([array[np.isfinite(array)] for array in arrays])
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    return LogNorm(low, high) if 0.0 < low < high / DECADES else Normalize(low, high)


def label_of(name: str, unit: str) -> str:
    words = name.replace("_", " ")
    return f"{words} [{unit}]" if unit else words


def format_bytes(count: float) -> str:
    """A size in the unit that suits it: 1.25e6 is "1.25 MB"."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000.0:
            return f"{count:.3g} {unit}"
        count /= 1000.0
    return f"{count:.3g} TB"
