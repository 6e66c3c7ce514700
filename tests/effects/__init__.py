"""Tests of `hybridyn/effects`."""
