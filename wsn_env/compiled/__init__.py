"""Elementary functions, randomness by key, and how kernels are compiled and kept."""
