"""The loop over particles that bear a load."""

from distfsi.device.markers import driver
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS
from distfsi.solid.formulas.loads import friedlander_integral

# Columns of a wave: when it arrives and how long its positive phase lasts [s], pressures [Pa] and decays.
ARRIVAL, DURATION, REFLECTED, REFLECTED_DECAY, INCIDENT, INCIDENT_DECAY, WAVE = 0, 1, 2, 3, 4, 5, 6


@driver
def bear_wave(begin, end, start, stop, wave, reflected, incident, impulse):
    """Add to impulse[i] that of a blast from `start` to `stop` [s], exactly.

    wave  (n, WAVE), no duration where there is none; reflected, incident  (n, D) areas [m^(D-1)] on which these parts
    of it press, along the force
    """
    for i in range(begin, end):
        duration = wave[i, DURATION]
        if duration > 0.0:
            first = min(max((start - wave[i, ARRIVAL]) / duration, 0.0), 1.0)
            last = min(max((stop - wave[i, ARRIVAL]) / duration, 0.0), 1.0)
            if last > first:
                decay = wave[i, REFLECTED_DECAY]
                change = friedlander_integral(decay, last) - friedlander_integral(decay, first)
                given = duration * wave[i, REFLECTED] * change
                decay = wave[i, INCIDENT_DECAY]
                change = friedlander_integral(decay, last) - friedlander_integral(decay, first)
                given_incident = duration * wave[i, INCIDENT] * change
                for d in static_range(DIMENSIONS):
                    impulse[i, d] += given * reflected[i, d] + given_incident * incident[i, d]
