"""distfsi: shock waves and blasts that hit structures until they bend, crack and fly apart."""

__version__ = "0.2.0"
