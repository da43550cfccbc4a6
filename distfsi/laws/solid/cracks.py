"""How a crack takes its energy, whatever opens it: linear softening (Hillerborg 1976).

A crack in particles that take up `width` [m] across it takes `fracture_energy` [J/m2], whatever the width; 0 means
failure at once.
"""

from distfsi.laws.law import Column, Load

DUCTILE_DAMAGE = Column("ductile_damage", "1", "used share of what plastic flow may do; above 1: a crack opens")
BRITTLE = 1e-300  # J/m2: smallest fracture energy, to divide by


def softening_share(work, fracture_energy, width):
    """Damage after a `work` [J/m3] on the intact material: plastic, and of its mean tension, which a crack lets go too.

    The damaged material takes 1 - damage of it, half of it all until it has failed: the crack's energy over its width.
    """
    return work * width / (2.0 * max(fracture_energy, BRITTLE))


def ductile_softening(used, damage, load: Load, fracture_energy, width):
    """Damage and ductile damage when plastic flow has `used` up such a share of what it may do.

    The ductile damage is that share up to 1, and then 1 and the share of its energy that the crack has taken by plastic
    flow. To the `damage` so far counts besides the energy of the mean tension, which a crack lets go.
    """
    worked = used + softening_share(load.increment * load.flow_stress, fracture_energy, width)
    ductile = min(worked, 2.0) if used >= 1.0 else used
    tension = min(load.pressure, 0.0)
    stored = softening_share(0.5 * tension * tension / load.bulk, fracture_energy, width)
    return (max(damage, min(ductile - 1.0 + stored, 1.0)) if used >= 1.0 else damage, ductile)


def tensile_damage(principal, energy, tensile_strength, fracture_energy, width):
    """Damage by a crack across the largest `principal` stress [Pa] of the intact material.

    `energy` [J/m3] is that of the intact material under its stress, so that the crack takes its own however the
    material is held across its direction. A particle too large to let its energy out slowly fails at once.
    """
    ratio = max(principal / tensile_strength, 1.0)
    widest = fracture_energy * ratio * ratio / (max(energy, BRITTLE) * width)  # strain of the open crack over the first
    soft = widest * (ratio - 1.0) / (ratio * max(widest - 1.0, BRITTLE))
    return (min(soft, 1.0) if widest > 1.0 else 1.0) if ratio > 1.0 else 0.0
