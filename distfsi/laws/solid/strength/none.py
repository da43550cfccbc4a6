"""A solid that flows like a fluid."""

from dataclasses import dataclass

from distfsi.laws.law import Strength


@dataclass(frozen=True)
class NoStrength(Strength):
    """No deviatoric stress."""

    def flow_stress_at_rest(self):
        return 0.0
