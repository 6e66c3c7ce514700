"""Programs beside the tests: break the code, write down what it computes, measure the shipped robots."""
