"""Attacks on the program and on its tests: mutants, failing file operations, damaged inputs."""
