"""Tests of `hybridyn/simulation`."""
