"""Mutants of elements, equilibrium and prediction."""

from __future__ import annotations

from tests.hostile.mutant_kinds import Mutant

_E = "tests/test_elements.py::"
_GRADIENT = _E + "test_gradient_is_the_derivative_of_the_strains"
_CURVATURE = _E + "test_curvature_is_the_derivative_of_the_force"
_SMALL = _E + "test_small_strains_are_motions_of_j_against_i"
_ENERGY = "tests/test_equilibrium.py::test_exact_is_the_least_energy"
_SHIPPED = "tests/test_jacobian.py::test_every_column_at_strained_poses"
_ROPES = "tests/test_slack_ropes.py::test_which_ropes_carry_follows_from_the_energy"
_S = "tests/test_survivors.py::"
_BEAM = "tests/test_beam_stiffness.py"

ENGINE = (
    Mutant("elements/bar.py", "return length - rest, (link", "return rest - length, (link", _GRADIENT),
    Mutant("elements/bar.py", "(tension / length**2)[..., None]", "(tension / length)[..., None]", _CURVATURE),
    Mutant("elements/bar.py", "add_scaled_identity(out, tension)", "add_scaled_identity(out, -tension)", _CURVATURE),
    Mutant("elements/beam.py", "[[4.0, 2.0], [2.0, 4.0]]", "[[4.0, 1.0], [1.0, 4.0]]", _BEAM),
    Mutant("elements/beam.py", "0.5 * (dot(iy, jz) - dot(iz, jy))", "dot(iy, jz) - dot(iz, jy)", _GRADIENT),
    Mutant("elements/beam.py", "tension - along)", "tension + along)", _CURVATURE),
    Mutant("elements/beam.py", "tj, 0.5 * stress[..., 1]", "tj, stress[..., 1]", _CURVATURE),
    Mutant("elements/joint.py", "((-1.0, 0, 1),)", "((1.0, 0, 1),)", _SMALL),
    Mutant(
        "elements/joint.py",
        'JointType(("y", "z", "rx", "ry", "rz")',
        'JointType(("y", "z", "rx", "ry")',
        _E + "test_null_space_of_a_joint_is_its_freedom",
    ),
    Mutant("elements/joint.py", "((0.5, 0, 2), (-0.5, 2, 0))", "((-0.5, 0, 2), (0.5, 2, 0))", _SMALL),
    Mutant(
        "elements/joint.py", "out[..., DELTA, THETA_I] -= tangent", "out[..., DELTA, THETA_I] += tangent", _CURVATURE
    ),
    Mutant(
        "elements/joint.py",
        "np.round(e[..., row].real",
        "np.floor(e[..., row].real",
        "tests/test_survivors.py::test_a_drive_may_be_a_little_behind_its_command",
    ),
    Mutant(
        "elements/element.py", "out[..., THETA_J, THETA_I] -= on_i", "out[..., THETA_J, THETA_I] += on_i", _CURVATURE
    ),
    Mutant("elements/element.py", "out[..., k, k] -= trace", "out[..., k, k] += trace", _CURVATURE),
    Mutant("elements/pulley.py", "(wrap + theta) - last * theta)", "(wrap + theta) + last * theta)", _GRADIENT),
    Mutant("elements/pulley.py", "-seen.arm[..., None] * seen.across", "seen.arm[..., None] * seen.across", _GRADIENT),
    Mutant(
        "elements/pulley.py",
        "np.asarray((seen.wrap - seen.sine)",
        "np.asarray((seen.wrap)",
        _E + "test_sizes_move_the_strain_by_their_derivative",
    ),
    Mutant(
        "elements/orientation.py", "b[..., THETA_J], b[..., THETA_I] = rows, -rows", "b[..., THETA_J] = rows", _GRADIENT
    ),
    Mutant(
        "equilibrium/assembly.py",
        "residual[:, where[k]] -= numbers",
        "residual[:, where[k]] += numbers",
        "tests/test_frames.py",
    ),
    Mutant("equilibrium/assembly.py", "np.where(pushing, 0.0, stress[..., 0])", "stress[..., 0]", _ROPES),
    Mutant(
        "equilibrium/stability.py",
        "out[0] = False",
        "out[0] = True",
        "tests/test_survivors.py::test_a_saddle_is_not_stable_whatever_rows_are_beside_it",
    ),
    Mutant(
        "equilibrium/mobility.py",
        "_RANK = 1e-8",
        "_RANK = 1e-1",
        "tests/test_mobility.py::test_counts_of_the_shipped_machines",
    ),
    Mutant("equilibrium/newton.py", "rows[~tangent.stable(rows)]", "rows[tangent.stable(rows)]", _ENERGY),
    Mutant(
        "equilibrium/kinematics.py",
        "rotation + np.swapaxes(cross(theta",
        "rotation - np.swapaxes(cross(theta",
        _SHIPPED + "[delta4]",
    ),
    Mutant(
        "equilibrium/derivative.py",
        "-= multipliers[:, :, where[k]]",
        "+= multipliers[:, :, where[k]]",
        "tests/test_jacobian.py::test_a_parameter_in_every_place_of_the_machine_file",
    ),
    Mutant("elements/element.py", "(0.5 if k == l else 1.0)", "1.0", _SHIPPED + "[biglide]"),
    Mutant(
        "equilibrium/derivative.py",
        "-1j * _STEP * points",
        "1j * _STEP * points",
        "tests/test_jacobian.py::test_a_parameter_in_every_place_of_the_machine_file",
    ),
    Mutant("equilibrium/energy.py", "energy = 0.5 * (e * stress)", "energy = (e * stress)", _ENERGY),
    Mutant("equilibrium/stresses.py", "stress += numbers.prestress", "stress -= numbers.prestress", _ENERGY),
    Mutant(
        "equilibrium/derivative.py",
        "energy = energy / length if",
        "energy = energy * length if",
        _SHIPPED + "[hangprinter]",
    ),
    Mutant(
        "prediction/solving.py",
        "scale, curved=False, taut=True)",
        "scale, taut=True)",
        "tests/test_survivors.py::test_linear_is_one_step_without_geometric_stiffness",
    ),
    Mutant(
        "prediction/solving.py", "(after < before) & ~stays", "(after > before) & ~stays", "tests/test_branches.py"
    ),
    Mutant("prediction/solving.py", "(after < before) & ~stays", "after < before", "tests/test_tensioned_platform.py"),
    Mutant(
        "prediction/displacements.py", "before * np.exp(moved) if", "before * (1 + moved) if", "tests/test_effects.py"
    ),
    Mutant(
        "prediction/displacements.py",
        "_displaced(placed, at, sizes), dtype=float) * on",
        "_displaced(placed, at, sizes), dtype=float)",
        "tests/test_sessions.py tests/test_effects.py",
    ),
    Mutant(
        "prediction/displacements.py",
        "by_moved = by_moved * coefficients[:, None, where]",
        "pass",
        "tests/test_effects.py",
    ),
    Mutant("prediction/forces.py", "drive.force_sign * balanced.stresses[index]", "balanced.stresses[index]", _ENERGY),
    Mutant(
        "prediction/inputs.py",
        "before * (weight - decay)",
        "before * weight",
        "tests/test_effects.py::test_lag_follows_its_differential_equation",
    ),
    Mutant(
        "prediction/inputs.py",
        "return self.travel - 0.5 * (low + high)",
        "return self.travel - low",
        "tests/test_effects.py tests/test_effects_truth.py",
    ),
    Mutant(
        "prediction/inverse_kinematics.py",
        "moved / coefficients[:, actuator.gain_coefficient]",
        "moved * coefficients[:, actuator.gain_coefficient]",
        "tests/test_equilibrium.py::test_inverse_positions_of_the_hangprinter",
    ),
    Mutant(
        "prediction/rigid_pose.py",
        "REACH = 0.01 ",
        "REACH = 0.1 ",
        _S + "test_parts_that_miss_one_another_by_a_hundredth_of_the_machine_do_not_close",
    ),
    Mutant(
        "prediction/forces.py",
        "sign * strain**2 / 2",
        "0 * sign * strain**2 / 2",
        _S + "test_tension_follows_the_stiffness_of_a_rope_that_stretches_by_some_per_cent",
    ),
    Mutant(
        "prediction/other_assemblies.py",
        "np.where(far & (misfit <= LEAST_MISFIT), 0.0, misfit)",
        "misfit",
        "tests/test_branches.py::test_what_is_known_of_a_pose_holds_nearby_only",
    ),
    Mutant(
        "model/freedoms.py",
        "squares -= misfit[todo, None] / _FOLD",
        "squares -= 0.0",
        "tests/test_branches.py",
    ),
    Mutant("prediction/stages.py", 'asked[k][1] in ("", s)', "True", "tests/test_sessions.py"),
    Mutant(
        "prediction/displacements.py",
        "np.zeros(len(rows))) > 0)",
        "np.zeros(len(rows))) >= 0)",
        "tests/test_sessions.py",
    ),
)
