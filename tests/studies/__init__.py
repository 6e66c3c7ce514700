"""Tests of `hybridyn/studies`."""
