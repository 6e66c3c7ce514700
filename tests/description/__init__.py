"""Tests of `hybridyn/description`."""
