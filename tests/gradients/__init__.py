"""Tests of gradients over parameters."""
