"""Tests of `hybridyn/manifold`."""
