"""How a crack takes its energy, whatever opens it: linear softening (Hillerborg 1976).

A crack in particles that take up `width` [m] across it takes `fracture_energy` [J/m2], whatever the width; 0 means
failure at once.
"""

BRITTLE = 1e-300  # J/m2: smallest fracture energy, to divide by


def softening_share(work, fracture_energy, width):
    """Damage after a `work` [J/m3] on the intact material: plastic, and of its mean tension, which a crack lets go too.

    The damaged material takes 1 - damage of it, half of it all until it has failed: the crack's energy over its width.
    """
    return work * width / (2.0 * max(fracture_energy, BRITTLE))


def tensile_damage(principal, energy, tensile_strength, fracture_energy, width):
    """Damage by a crack across the largest `principal` stress [Pa] of the intact material.

    `energy` [J/m3] is that of the intact material under its stress, so that the crack takes its own however the
    material is held across its direction. A particle too large to let its energy out slowly fails at once.
    """
    ratio = max(principal / tensile_strength, 1.0)
    widest = fracture_energy * ratio * ratio / (max(energy, BRITTLE) * width)  # strain of the open crack over the first
    soft = widest * (ratio - 1.0) / (ratio * max(widest - 1.0, BRITTLE))
    return (min(soft, 1.0) if widest > 1.0 else 1.0) if ratio > 1.0 else 0.0
