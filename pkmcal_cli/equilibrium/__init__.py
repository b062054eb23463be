"""The elasto-geometrical engine: kinematics of arms, assembly, rigid pose, elastic equilibrium, exact derivatives."""
