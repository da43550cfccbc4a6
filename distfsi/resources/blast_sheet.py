"""The blast of a charge in air, from the curves of Kingery and Bulmash, as a table and as charts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from distfsi.air_blast import END, AirBlast, Burst, air_blast, friedlander, friedlander_decay

POINTS = 300


def sheet(burst: Burst, mass: float, blasts: Mapping[float, AirBlast]) -> str:
    """The table of `blasts` by distance [m], and the range of the curves in words."""
    lines = [f"{mass:g} kg of TNT, {burst.name}"]
    for distance, blast in blasts.items():
        lines += [
            "",
            f"at {distance:g} m, scaled distance {blast.scaled_distance:.4g} m/kg^(1/3):",
            f"  arrival        {1e3 * blast.arrival:10.4g} ms",
            f"  positive phase {_duration(blast.duration)}",
            f"  incident       {1e-3 * blast.incident_pressure:10.4g} kPa {blast.incident_impulse:10.4g} Pa s",
            f"  reflected      {1e-3 * blast.reflected_pressure:10.4g} kPa {blast.reflected_impulse:10.4g} Pa s",
            f"  decay          {_decays(blast)}",
        ]
    scale = mass ** (1.0 / 3.0)
    return "\n".join(
        [
            *lines,
            "",
            f"The curves hold from {burst.start:g} to {END:g} m/kg^(1/3), here {burst.start * scale:.4g} to"
            f" {END * scale:.4g} m, those of the duration from {burst.first_duration:g} on.",
            "decay: b of Friedlander's wave p = P (1 - t/t0) exp(-b t/t0) with this peak, duration and impulse.",
            "Measured blasts scatter about them by some 10 %; they hold what TNT burns with air.",
        ]
    )


def _duration(duration: float | None) -> str:
    return "          none: the curves have none so near" if duration is None else f"{1e3 * duration:10.4g} ms"


def _decays(blast: AirBlast) -> str:
    if blast.duration is None:
        return "          none without a duration"
    words = []
    for kind in ("incident", "reflected"):
        decay = friedlander_decay(getattr(blast, f"{kind}_pressure"), blast.duration, getattr(blast, f"{kind}_impulse"))
        short = "none: even a straight line falls short of the impulse"
        words.append(f"{kind} {short if decay is None else f'{decay:.3g}'}")
    return "          " + ", ".join(words)


def draw(burst: Burst, mass: float, blasts: Mapping[float, AirBlast], path: Path) -> Path:
    """Draw the waves at the distances, and peaks and impulses over the distance; returns `path`."""
    from distfsi.output.charts import Chart, Curve, draw_charts

    waves: dict[str, list[Curve]] = {"incident": [], "reflected": []}
    for distance, blast in blasts.items():
        for kind, curves in waves.items():
            time, pressure = _wave(blast, kind)
            curves.append(Curve(1e3 * time, pressure / 1e3, f"{distance:g} m"))
    scale = mass ** (1.0 / 3.0)
    distances = np.geomspace(1.001 * burst.start, 0.999 * END, POINTS) * scale
    along = [air_blast(mass, float(distance), burst) for distance in distances]
    charts = [Chart(f"{kind} wave", "time [ms]", "overpressure [kPa]", curves) for kind, curves in waves.items()]
    for name, unit, size in (("pressure", "kPa", 1e-3), ("impulse", "Pa s", 1.0)):
        curves = [
            Curve(np.log10(distances), np.log10([size * getattr(b, f"{kind}_{name}") for b in along]), None, style)
            for kind, style in (("incident", "-"), ("reflected", "--"))
        ]
        charts.append(
            Chart(f"{name} [{unit}]: incident -, reflected --", "log10 of the distance [m]", f"log10 {name}", curves)
        )
    return draw_charts(path, charts, 2)


def _wave(blast: AirBlast, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and overpressures [Pa] of the positive phase; a straight line where no decay has the impulse."""
    peak, impulse = getattr(blast, f"{kind}_pressure"), getattr(blast, f"{kind}_impulse")
    duration = blast.duration or 2.0 * impulse / peak
    decay = friedlander_decay(peak, duration, impulse) or 0.0
    after = np.linspace(0.0, duration, POINTS)
    pressure = np.array([friedlander(peak, duration, decay, float(t)) for t in after])
    return np.concatenate([[0.0, blast.arrival], blast.arrival + after]), np.concatenate([[0.0, 0.0], pressure])
