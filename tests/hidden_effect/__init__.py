"""Measurement campaigns of machines that hide a physical effect, to try a diagnosis on, blind.

A machine of its own: beam, ball bearing and cut are simulated by code that shares nothing with the program that is
tested (a test and an import contract hold it to that), nonlinear in time, and the hidden effects follow laws that the
program's own do not.
"""
