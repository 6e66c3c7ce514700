"""Tests of `hybridyn/figures`."""
