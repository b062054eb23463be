"""The elasto-geometrical engine: kinematics, assembly, rigid pose, elastic equilibrium, exact derivatives."""
