"""Tests of `hybridyn/view`."""
