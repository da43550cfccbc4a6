"""Names that a scene fixes. Formulas import them from here; emission puts the scene's values and formulas in their
place.

Each symbol says what it stands for; a formula that is emitted while one of its symbols is still open is refused.
"""


class Symbol:
    """A constant that the scene gives (a number, a truth value or a tuple of numbers)."""

    def __init__(self, meaning: str):
        self.meaning = meaning


def chosen(name: str, meaning: str):
    """A formula that the scene chooses."""

    def formula(*arguments):
        raise NotImplementedError(f"{name} ({meaning}) is chosen by the scene")

    formula.__name__, formula.__doc__ = name, meaning
    return formula


DIMENSIONS = Symbol("number of space dimensions, 1 to 3")
MINIMUM_ISOLATED = Symbol(
    "minimum isolated volume fraction: with more a cell stands alone where it has no merge target"
)
LANES = Symbol("how many items of a list a thread of the device computes side by side")
TRANSFERRED = Symbol("transfer components: values that a cell gives to the particles around it, the velocity first")

# ---- fluid -----------------------------------------------------------------------------------------------------------

PHASES = Symbol("number of fluid materials: 1 (Euler) or 2 to 5 (six- or five-equation model)")
VARIABLES = Symbol(
    "stored fields per cell: PHASES + DIMENSIONS + 1, volume fractions of all phases but one, and what is CARRIED"
)
CARRIED = Symbol("how many shares a phase carries along, each of which holds back an energy from the pressure")
CARRIER = Symbol("index of that phase")
HELD_ENERGY = Symbol("energy that each of the carried shares holds back [J/kg]")
BURNS = Symbol("whether the first of the shares is that of an explosive that is unburnt")
AFTERBURNS = Symbol("whether the last of the shares is that of products that is left to burn with air")
RELAXES = Symbol("whether phases come to one pressure by changes of their volumes")
FLUXES = Symbol(
    "values per face: VARIABLES, of several phases the face velocity, before it in six equations their energies"
)
BODY_FORCE = Symbol("body force per mass, one component per dimension [m/s2], the mean over the step")
MINIMUM_FRACTION = Symbol("volume fractions stay within this distance of 0 and 1")
REST_DENSITY = Symbol("density at which energies that are counted from rest vanish with the pressure [kg/m3]")
CLOSED_FORM = Symbol("whether phases relax along hyperbolas: two of them to the root of a quadratic")

FRACTIONAL = Symbol("whether cells beside a wall that moves may hold more or less fluid than their volume")
BISECTION_FALLBACK = Symbol("whether relaxation may need more than its fixed number of fits: then bisection")
GHOSTS = Symbol("layers of ghost cells: how many cells on each side a face looks at")
RADIAL = Symbol("whether the first axis is the distance from a point or an axis (coordinates/)")
SHARES = Symbol("parts of a cell's change that the limiter looks at: its faces, and in r what their areas differ by")
SHARPENED = Symbol("whether volume fractions have a reconstruction of its own")
ASYMMETRIC = Symbol("whether the increments from a cell's mean to its two faces differ")
HYDROSTATIC = Symbol("whether a body force acts, whose weight the pressures of cells beside each other differ by")
TRANSVERSE_SENSOR = Symbol("whether the flux of a face depends on pressures beside its two cells")

reference_1 = chosen("reference_1", "phase 1: rho -> (reference pressure [Pa], its slope with rho [m2/s2])")
reference_2 = chosen("reference_2", "phase 2: rho -> (reference pressure [Pa], its slope with rho [m2/s2])")
reference_3 = chosen("reference_3", "phase 3: rho -> (reference pressure [Pa], its slope with rho [m2/s2])")
reference_4 = chosen("reference_4", "phase 4: rho -> (reference pressure [Pa], its slope with rho [m2/s2])")
reference_5 = chosen("reference_5", "phase 5: rho -> (reference pressure [Pa], its slope with rho [m2/s2])")
grueneisen_1 = chosen("grueneisen_1", "phase 1: rho -> (Grueneisen coefficient omega, its slope with rho [m3/kg])")
grueneisen_2 = chosen("grueneisen_2", "phase 2: rho -> (Grueneisen coefficient omega, its slope with rho [m3/kg])")
grueneisen_3 = chosen("grueneisen_3", "phase 3: rho -> (Grueneisen coefficient omega, its slope with rho [m3/kg])")
grueneisen_4 = chosen("grueneisen_4", "phase 4: rho -> (Grueneisen coefficient omega, its slope with rho [m3/kg])")
grueneisen_5 = chosen("grueneisen_5", "phase 5: rho -> (Grueneisen coefficient omega, its slope with rho [m3/kg])")
stored_reference_1 = chosen(
    "stored_reference_1", "as reference_1, to the energy that is stored: p = reference + omega rho e"
)
stored_reference_2 = chosen("stored_reference_2", "as reference_2, to the energy that is stored")
stored_reference_3 = chosen("stored_reference_3", "as reference_3, to the energy that is stored")
stored_reference_4 = chosen("stored_reference_4", "as reference_4, to the energy that is stored")
stored_reference_5 = chosen("stored_reference_5", "as reference_5, to the energy that is stored")
limited_slope = chosen("limited_slope", "(backward difference, forward difference) -> limited slope")
reconstructed = chosen(
    "reconstructed",
    "cells around and with one -> increments from its low face to its mean, from there to its high face",
)
reconstructed_in_r = chosen(
    "reconstructed_in_r", "as reconstructed along r, with the nearness to both sides, and the way from the low face"
)
sharpened = chosen("sharpened", "as reconstructed, of volume fractions")
falls = chosen("falls", "time step, and that over the size of a cell along three axes -> g h along each [m2/s2]")
beyond_rest = chosen("beyond_rest", "pressures and densities of cells around one, g h -> pressures without the weight")
primitives = chosen("primitives", "conserved state -> primitive state")
conserved = chosen("conserved", "primitive state -> conserved state")
face_flux = chosen("face_flux", "left and right primitive states, normal velocity first; pressure jump -> fluxes")
bounding_speeds = chosen("bounding_speeds", "rho, u, c of both sides -> slowest and fastest wave [m/s]")
contact_jump_diffusion = chosen("contact_jump_diffusion", "wave speeds -> flux per jump across a contact [m/s]")
slip_viscosity = chosen("slip_viscosity", "impedances, pressure jump, rho c^2 -> momentum flux per slip [kg/(m2 s)]")
state_behind_wave = chosen("state_behind_wave", "primitive state, wave and face speeds -> all transported densities")
limiter_indicator = chosen(
    "limiter_indicator", "cell means, flux, sound speed, rate -> negative where the flux may need limiting"
)
is_admissible = chosen("is_admissible", "cell means, flux, rate -> whether the flux alone leaves both cells valid")
limited_flux = chosen("limited_flux", "cell means, flux, pressure jump, rate -> a flux that leaves both cells valid")
updated = chosen("updated", "the state after a Runge-Kutta stage")
before_relaxation = chosen("before_relaxation", "as updated -> where both phases stand, transport's change of a1")
range_of_change = chosen("range_of_change", "where both phases stand -> least and largest change of a1 by relaxation")
halved_range = chosen("halved_range", "where both phases stand, range of changes -> the half with one pressure")
fraction_after = chosen("fraction_after", "state before the step, change in the stage -> volume fraction")
unburnt_share = chosen("unburnt_share", "Burn.unburnt of the explosive")
afterburn_left = chosen("afterburn_left", "Afterburn.left of the products")
bulk_modulus = chosen("bulk_modulus", "primitive state -> rho c^2 [Pa], positive where the state is admissible")
sound_speed = chosen("sound_speed", "primitive state -> frozen speed of sound [m/s]")

# ---- solid -----------------------------------------------------------------------------------------------------------

COMPONENTS = Symbol("stored components of a symmetric tensor: DIMENSIONS (DIMENSIONS + 1)/2")
VISCOSITY_ALPHA = Symbol("artificial viscosity, linear part")
VISCOSITY_BETA = Symbol("artificial viscosity, quadratic part")
SMOOTHING_RATIO = Symbol("smoothing length over particle spacing")
ARTIFICIAL_STRESS = Symbol("share of the tension with which close particles push each other away; 0: none")
FRICTION = Symbol("Coulomb's coefficient between bodies; 0: none")
WALL_FRICTION = Symbol("Coulomb's coefficient between bodies and walls of the domain; 0: none")
ZERO_ENERGY = Symbol("stiffness against what the deformation gradient does not see, in shear moduli")
POLAR_ROTATION = Symbol("whether stresses turn with the rotation of the polar decomposition; else with the vorticity")
FAILS = Symbol("whether the material, outside the material's kernels any material, can fail")
SCATTERED = Symbol("whether the strength of the material scatters from particle to particle")
YIELDS = Symbol("whether any material has a plastic strain")
EOS_FIELDS = Symbol("numbers of the material's equation of state")
STRENGTH_FIELDS = Symbol("numbers of its strength model")
FAILURE_FIELDS = Symbol("numbers of its failure model")
EOS_COLUMNS = Symbol("how many numbers a particle remembers for its equation of state")
STRENGTH_COLUMNS = Symbol("for its strength model")
FAILURE_COLUMNS = Symbol("for its failure model")
eos_response = chosen("eos_response", "SolidEos.respond of the material's equation of state")
free_swelling = chosen("free_swelling", "SolidEos.free_swelling")
strength_response = chosen("strength_response", "Strength.respond of the material's strength model")
elastic_density = chosen("elastic_density", "Strength.elastic_density")
carried_share = chosen("carried_share", "Strength.carried_share")
homologous_temperature = chosen("homologous_temperature", "Strength.homologous_temperature")
failure_response = chosen("failure_response", "Failure.respond of the material's failure model")
