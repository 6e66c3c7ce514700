"""Tests of `hybridyn/dynamics`."""
