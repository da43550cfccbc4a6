"""Blast of TNT in air from the curves of Kingery and Bulmash, which UFC 3-340-02 and ConWep use.

Kingery & Bulmash, Airblast Parameters from TNT Spherical Air Burst and Hemispherical Surface Burst, ARBRL-TR-02555,
1984: the logarithm of each quantity is a polynomial of u = a + b log10 Z, with the scaled distance Z = R/W^(1/3). Sea
level.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log10

BISECTIONS = 60
LARGEST_DECAY = 1e3
LONGEST_IMPULSE = 0.5  # of peak times duration, which a straight line reaches


@dataclass(frozen=True)
class Curve:
    """10 to the power of a polynomial of u = offset + slope log10 Z, up to `end` [m/kg^(1/3)]."""

    end: float
    offset: float
    slope: float
    coefficients: tuple[float, ...]

    def __call__(self, scaled_distance: float) -> float:
        u, value = self.offset + self.slope * log10(scaled_distance), 0.0
        for coefficient in reversed(self.coefficients):
            value = value * u + coefficient
        return float(10.0**value)


@dataclass(frozen=True)
class Burst:
    """The curves of a kind of burst, scaled to 1 kg: kPa, kPa ms, ms; `start`, and the least distance with a
    duration, in m/kg^(1/3)."""

    name: str
    start: float
    first_duration: float
    incident_pressure: tuple[Curve, ...]
    reflected_pressure: tuple[Curve, ...]
    incident_impulse: tuple[Curve, ...]
    reflected_impulse: tuple[Curve, ...]
    arrival: tuple[Curve, ...]
    duration: tuple[Curve, ...]


END = 40.0  # of all curves [m/kg^(1/3)]

# fmt: off
FREE_AIR = Burst(
    "sphere in free air", 0.0531, 0.147,
    incident_pressure=(Curve(END, -0.214362789151, 1.35034249993, (
        2.611368669, -1.69012801396, 0.00804973591951, 0.336743114941, -0.00516226351334, -0.0809228619888,
        -0.00478507266747, 0.00793030472242, 0.0007684469735)),),
    reflected_pressure=(Curve(END, -0.214362789151, 1.35034249993, (
        3.22958031387, -2.21400538997, 0.035119031446, 0.657599992109, 0.0141818951887, -0.243076636231,
        -0.0158699803158, 0.0492741184234, 0.00227639644004, -0.00397126276058)),),
    incident_impulse=(
        Curve(0.792, 2.34723921354, 3.24299066475, (
            2.38830516757, -0.443749377691, 0.168825414684, 0.0348138030308, -0.010435192824)),
        Curve(END, -1.75305660315, 2.30629231803, (
            1.55197227115, -0.40463292088, -0.0142721946082, 0.00912366316617, -0.0006750681404, -0.00800863718901,
            0.00314819515931, 0.00152044783382, -0.0007470265899)),),
    reflected_impulse=(Curve(END, -0.204004553231, 1.37882996018, (
        2.55875660396, -0.903118886091, 0.101771877942, -0.0242139751146)),),
    arrival=(Curve(END, -0.253273111999, 1.37407043777, (
        0.0720707787637, 1.36456871214, -0.0570035692784, -0.182832224796, 0.0118851436014, 0.0432648687627,
        -0.0007997367834, -0.00436073555033)),),
    duration=(
        Curve(0.888, 2.26367268496, 5.11588554305, (
            -0.686608550419, 0.164953518069, 0.127788499497, 0.00291430135946, 0.0018795744922, 0.0173413962543,
            0.00269739758043, -0.00361976502798, -0.00100926577934)),
        Curve(2.28, -1.33361206714, 9.2996288611, (
            0.23031841078, -0.0297944268969, 0.0306329542941, 0.018340557407, -0.0173964666286, -0.00106321963576,
            0.0056206003128, 0.0001618217499, -0.0006860188944)),
        Curve(END, -3.13005805346, 3.1524725364, (
            0.621036276475, 0.0967031995552, -0.00801302059667, 0.00482705779732, 0.00187587272287, -0.00246738509321,
            -0.000841116668, 0.0006193291052)),),
)

SURFACE = Burst(
    "hemisphere on the ground", 0.0674, 0.178,
    incident_pressure=(Curve(END, -0.214362789151, 1.35034249993, (
        2.78076916577, -1.6958988741, -0.154159376846, 0.514060730593, 0.0988534365274, -0.293912623038,
        -0.0268112345019, 0.109097496421, 0.00162846756311, -0.0214631030242, 0.0001456723382, 0.00167847752266)),),
    reflected_pressure=(Curve(END, -0.240657322658, 1.36637719229, (
        3.40283217581, -2.21030870597, -0.218536586295, 0.895319589372, 0.24989009775, -0.569249436807,
        -0.11791682383, 0.224131161411, 0.0245620259375, -0.0455116002694, -0.00190930738887, 0.00361471193389)),),
    incident_impulse=(
        Curve(0.955, 2.06761908721, 3.0760329666, (
            2.52455620925, -0.502992763686, 0.171335645235, 0.0450176963051, -0.0118964626402)),
        Curve(END, -1.94708846747, 2.40697745406, (
            1.67281645863, -0.384519026965, -0.0260816706301, 0.00595798753822, 0.014544526107, -0.00663289334734,
            -0.00284189327204, 0.0013644816227)),),
    reflected_impulse=(Curve(END, -0.246208804814, 1.33422049854, (
        2.70588058103, -0.949516092853, 0.112136118689, -0.0250659183287)),),
    arrival=(Curve(END, -0.202425716178, 1.37784223635, (
        -0.0591634288046, 1.35706496258, 0.052492798645, -0.196563954086, -0.0601770052288, 0.0696360270891,
        0.0215297490092, -0.0161658930785, -0.00232531970294, 0.00147752067524)),),
    duration=(
        Curve(1.01, 1.92946154068, 5.25099193925, (
            -0.614227603559, 0.130143717675, 0.134872511954, 0.0391574276906, -0.00475933664702, -0.00428144598008)),
        Curve(2.78, -2.12492525216, 9.2996288611, (
            0.315409245784, -0.0297944268976, 0.030632954288, 0.0183405574086, -0.0173964666211, -0.00106321963633,
            0.0056206030977, 0.0001618217499, -0.0006860188944)),
        Curve(END, -3.53626218091, 3.46349745571, (
            0.686906642409, 0.0933035304009, -0.0005849420883, -0.00226884995013, -0.00295908591505,
            0.00148029868929)),),
)
# fmt: on


@dataclass(frozen=True)
class AirBlast:
    """Blast at a point: times [s] from the detonation, overpressures [Pa], impulses of the positive phase [Pa s].
    Reflected: at a large wall that the front meets head on.

    duration  of the positive phase [s]; None where the curves have none
    """

    scaled_distance: float
    arrival: float
    duration: float | None
    incident_pressure: float
    incident_impulse: float
    reflected_pressure: float
    reflected_impulse: float


def air_blast(mass: float, distance: float, burst: Burst = FREE_AIR) -> AirBlast:
    """The blast of so much TNT [kg] at a distance [m] from its center; raises ValueError, in words, out of range."""
    scale = mass ** (1.0 / 3.0)
    z = distance / scale
    if not burst.start <= z <= END:
        raise ValueError(
            f"scaled distance {z:.4g} m/kg^(1/3); the curves of a {burst.name} hold from {burst.start:g} to {END:g},"
            f" for {mass:g} kg from {burst.start * scale:.4g} to {END * scale:.4g} m"
        )

    def at(curves: tuple[Curve, ...]) -> float:
        return next(curve for curve in curves if z <= curve.end)(z)

    return AirBlast(
        z,
        1e-3 * scale * at(burst.arrival),
        1e-3 * scale * at(burst.duration) if z >= burst.first_duration else None,
        1e3 * at(burst.incident_pressure),
        scale * at(burst.incident_impulse),
        1e3 * at(burst.reflected_pressure),
        scale * at(burst.reflected_impulse),
    )


# ---- Friedlander's wave ----------------------------------------------------------------------------------------------


def friedlander(pressure: float, duration: float, decay: float, time: float) -> float:
    """Overpressure [Pa] at a `time` [s] after the arrival: pressure (1 - s) exp(-decay s), s = time/duration."""
    share = time / duration
    return pressure * (1.0 - share) * exp(-decay * share)


def friedlander_decay(pressure: float, duration: float, impulse: float) -> float | None:
    """The decay b with which a wave of this peak [Pa] and duration [s] has this impulse [Pa s]; None where none has,
    since even a straight line falls short of it.

    impulse/(pressure duration) = 1/b - (1 - exp(-b))/b^2, which falls from 1/2 at b = 0: bisection.
    """
    wanted = impulse / (pressure * duration)
    if wanted >= LONGEST_IMPULSE:
        return None
    low, high = 1e-6, LARGEST_DECAY
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        share = 1.0 / middle - (1.0 - exp(-middle)) / (middle * middle)
        low, high = (middle, high) if share > wanted else (low, middle)
    return 0.5 * (low + high)
