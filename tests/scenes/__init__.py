"""Tests of `hybridyn/scenes`."""
