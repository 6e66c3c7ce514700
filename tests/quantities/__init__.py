"""Tests of `hybridyn/quantities`."""
