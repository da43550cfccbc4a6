"""Every law of solids in CUDA C, run on the host: the bits of the CPU's kernels."""

import numpy as np
import pytest
from test_drucker_prager_cap import EOS as SOIL_EOS
from test_drucker_prager_cap import SOIL
from test_johnson_holmquist import EOS as GLASS_EOS
from test_johnson_holmquist import GLASS
from test_material import HJC, HJC_EOS, STEEL, STEEL_EOS
from test_zerilli_armstrong import IRON

from distfsi.device.gpu import Gpu
from distfsi.device.host import HostRuntime
from distfsi.laws.law import Failure, SolidEos, Strength
from distfsi.laws.registry import laws_of
from distfsi.laws.solid.eos.mie_grueneisen import MieGrueneisen
from distfsi.laws.solid.failure.cockcroft_latham import CockcroftLatham
from distfsi.laws.solid.failure.johnson_cook import JohnsonCookFailure
from distfsi.laws.solid.failure.principal_stress import PrincipalStress
from distfsi.laws.solid.scatter import Scatter
from distfsi.laws.solid.strength.elastic import Elastic
from distfsi.laws.solid.strength.linear_hardening import LinearHardening
from distfsi.laws.solid.strength.none import NoStrength
from distfsi.laws.solid.strength.perfectly_plastic import PerfectlyPlastic
from material_point import Points, body_of

COPPER_EOS, SCATTER = MieGrueneisen(3940.0, 1.489, 0.1, 0.05, 2.0, 0.47), Scatter(8.0, 1e-3, 1)
DUCTILE = JohnsonCookFailure(0.05, 0.1, -2.12, 0.002, 0.61, 1.0, 3e9, 1e3, SCATTER)
BODIES = [  # eos, strength, density, failure
    (COPPER_EOS, STEEL, 8930.0, DUCTILE),
    (STEEL_EOS, IRON, 7870.0, CockcroftLatham(40e6, 1e3, None)),
    (STEEL_EOS, PerfectlyPlastic(77e9, 4e8), 7830.0, None),
    (STEEL_EOS, LinearHardening(77e9, 4e8, 2e9), 7830.0, DUCTILE),
    (STEEL_EOS, Elastic(77e9), 7830.0, PrincipalStress(1e9, 300.0, SCATTER)),
    (COPPER_EOS, NoStrength(), 8930.0, None),
    (HJC_EOS, HJC, 2440.0, PrincipalStress(3.6e6, 80.0, None)),
    (HJC_EOS, HJC, 2440.0, None),
    (GLASS_EOS, GLASS, 2530.0, None),
    (SOIL_EOS, SOIL, 1700.0, None),
]


def test_no_law_is_left_out():
    for kind, place in ((SolidEos, 0), (Strength, 1), (Failure, 3)):
        assert set(laws_of(kind)) == {type(body[place]) for body in BODIES if body[place]}


@pytest.mark.full
def test_the_cuda_c_of_all_laws_has_the_bits_of_the_cpu():
    D = 2
    bodies = [body_of(*body, D=D) for body in BODIES]
    number = np.repeat(np.arange(len(bodies)), 3)
    both = [Points(bodies, number, "green_naghdi", D, device) for device in (None, Gpu(HostRuntime()))]
    random = np.random.default_rng(3)
    mean = random.standard_normal((len(number), D, D))
    for _ in range(40):
        gradient = 2e5 * (mean + 0.5 * random.standard_normal(mean.shape))
        for points in both:
            points.strain(1e-8, gradient)
    first, second = (points.columns for points in both)
    assert first["damage"].max() > 0.0
    for name in first:
        assert first[name].tobytes() == second[name].tobytes(), name
