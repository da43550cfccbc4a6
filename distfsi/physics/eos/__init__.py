"""Equations of state of the fluid, all of Mie-Grueneisen form p = reference(rho) + omega rho e with constant omega.

An equation of state is one file with one function, `reference(rho) -> (pressure, slope)`; the model does the rest. The
constants it uses, and OMEGA, are given by `model.py`.
"""
