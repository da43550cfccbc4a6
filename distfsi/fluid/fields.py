"""What is written and said of cells, from their states U (variables, z, y, x) in double precision."""

from __future__ import annotations

import numpy as np

from distfsi.fluid.model import FluidModel


def names(model: FluidModel) -> list[str]:
    """Of the fields that are written of cells; the velocity has three components."""
    return ["density", "velocity", "pressure", *fraction_names(model), *model.carried]


def fraction_names(model: FluidModel) -> list[str]:
    """Of the volume fractions that are written: of two phases that of the first, of more that of each."""
    if model.phases < 3:
        return ["volume_fraction"] * (model.phases - 1)
    return [f"volume_fraction_{name}" for name in model.names]


def written_fractions(model: FluidModel, U: np.ndarray) -> list[np.ndarray]:
    """Those fractions of states (variables, ...)."""
    found = list(U[model.fraction : model.fraction + model.phases - 1])
    return found if model.phases < 3 else [*found, 1.0 - sum(found)]


def written(model: FluidModel, U: np.ndarray) -> dict[str, np.ndarray]:
    """Those fields: (z, y, x), of the velocity (z, y, x, 3)."""
    W, P, D = model.formula("primitives")(U), model.phases, model.dimensions
    velocity = np.zeros((*U.shape[1:], 3))
    velocity[..., :D] = np.stack(W[P : P + D], axis=-1)
    behind = (W[P + D], *written_fractions(model, U), *W[2 * P + D :])
    return dict(zip(names(model), (U[:P].sum(axis=0), velocity, *behind), strict=True))


def speeds(model: FluidModel, U: np.ndarray) -> list[np.ndarray]:
    """|u| + c [m/s] along each axis; NaN where a state is invalid."""
    with np.errstate(all="ignore"):
        W = model.formula("primitives")(U)
        c = model.formula("sound_speed")(W)
    return [np.abs(W[model.phases + d]) + c for d in range(model.dimensions)]


def first_invalid(model: FluidModel, U: np.ndarray, ignored: np.ndarray | bool) -> tuple[tuple[int, ...], str] | None:
    """The first cell (z, y, x), but for the `ignored` ones, whose state is invalid, and the state in words."""
    with np.errstate(all="ignore"):
        W = np.stack(model.formula("primitives")(U))
        c = np.asarray(model.formula("sound_speed")(tuple(W)))
    valid = np.isfinite(c) & np.isfinite(W).all(axis=0) | ignored
    if valid.all():
        return None
    z, y, x = np.argwhere(~valid)[0].tolist()
    values = zip([*_primitives(model), "sound speed"], [*W[:, z, y, x], c[z, y, x]], strict=True)
    return (z, y, x), ", ".join(f"{name} {value:.6g}" for name, value in values)


def _primitives(model: FluidModel) -> list[str]:
    """The names of the primitives."""
    phases, axes = range(model.phases), "xyz"[: model.dimensions]
    fractions = (
        [f"volume fraction {k + 1}" for k in phases[:-1]]
        if model.phases > 2
        else ["volume fraction"] * (model.phases - 1)
    )
    behind = ["pressure", *fractions, *model.carried]
    return [*(f"density_{k + 1}" for k in phases), *(f"velocity_{a}" for a in axes), *behind]
