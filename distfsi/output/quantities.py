"""Units of the fields that are written."""

from __future__ import annotations

from distfsi.laws.registry import column_units

UNITS = {
    "density": "kg/m³",
    "pressure": "Pa",
    "velocity": "m/s",
    "speed": "m/s",
    "energy": "J/kg",
    "von_mises": "Pa",
    "stress": "Pa",
    "overpressure": "Pa",
    "impulse": "Pa s",
    "peak_overpressure": "Pa",
    "peak_dynamic_pressure": "Pa",
    "positive_impulse": "Pa s",
    "arrival_time": "s",
    **column_units(),
}
