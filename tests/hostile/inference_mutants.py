"""Mutants of calibration and diagnosis."""

from __future__ import annotations

from tests.hostile.mutant_kinds import Mutant

_S = "tests/test_survivors.py::"
_LINEAR = "tests/test_diagnosis_linear.py::"
_SCORES = _LINEAR + "test_scores_are_those_of_least_squares"
_ISO = "tests/test_positioning_accuracy.py"
_ROWS = "tests/test_rows_by_session.py"

INFERENCE = (
    Mutant(
        "calibration/step.py",
        "free & ((step < room_down - 1e-12) | (step > room_up + 1e-12))",
        "free & (step < room_down - 1e12)",
        "tests/test_identify.py",
    ),
    Mutant("calibration/identify.py", "2 * len(failed) >=", "0 * len(failed) >=", "tests/test_identify.py"),
    Mutant(
        "calibration/identify.py",
        "+ near.known - max(moved, 0)",
        "+ near.known + max(moved, 0)",
        "tests/test_identify.py tests/test_intervals.py",
    ),
    Mutant(
        "calibration/misfit.py",
        "measured - period * np.round(",
        "measured + period * np.round(",
        "tests/test_residual_turns.py",
    ),
    Mutant(
        "calibration/misfit.py",
        "np.where(near[:, None], other, measured)",
        "np.where(near[:, None], measured, other)",
        "tests/test_residual_turns.py",
    ),
    Mutant(
        "calibration/whitening.py",
        "covariance = spread @ np.swapaxes(spread, 1, 2)",
        "covariance = 0 * spread @ np.swapaxes(spread, 1, 2)",
        "tests/test_identify.py",
    ),
    Mutant(
        "calibration/identifiability.py",
        "1.0 / self.singular_values**2)",
        "1.0 / self.singular_values)",
        "tests/test_identifiability.py",
    ),
    Mutant(
        "calibration/identifiability.py",
        "np.where(self.held, WEAK**-2",
        "np.where(self.held, 0.0",
        "tests/test_identifiability.py",
    ),
    Mutant(
        "calibration/error_budget.py",
        "by_held=gain @ whole[:p, p:] * scale",
        "by_held=0 * gain @ whole[:p, p:] * scale",
        "tests/test_error_budget.py",
    ),
    Mutant(
        "calibration/holdout.py",
        "np.nonzero(labels != fold)[0]",
        "np.nonzero(labels == labels)[0]",
        "tests/test_holdout.py::test_figures_are_those_of_fits_without_the_fold",
    ),
    Mutant(
        "calibration/robust.py",
        "_HUBER / size)",
        "(_HUBER / size) ** 2)",
        "tests/test_robust.py::test_weights_are_those_of_the_books",
    ),
    Mutant(
        "calibration/prior.py",
        "np.diag(2.0 / model.ranges[index])",
        "np.diag(1.0 / model.ranges[index])",
        "tests/test_survivors.py::test_a_range_is_two_standard_deviations_of_its_prior",
    ),
    Mutant(
        "calibration/replicates.py",
        "freedom = int(many.sum()) - int((size > 1).sum())",
        "freedom = int(many.sum())",
        "tests/test_replicates.py",
    ),
    Mutant(
        "calibration/positioning_accuracy.py",
        "4 * s.max(axis=1))",
        "3 * s.max(axis=1))",
        _S + "test_repeatability_of_an_axis_is_four_standard_deviations_without_reversal",
    ),
    Mutant("calibration/positioning_accuracy.py", "distance.mean() + 3 *", "distance.mean() + 2 *", _ISO),
    Mutant(
        "diagnosis/confirm.py",
        "train, test = fold_of != fold, labels == fold",
        "train, test = fold_of >= 0, labels == fold",
        _S + "test_a_held_out_row_has_no_part_in_its_own_prediction",
    ),
    Mutant(
        "diagnosis/confirm.py",
        "return self.gain > self.error",
        "return self.gain > 0",
        _S + "test_a_gain_within_its_error_confirms_nothing",
    ),
    Mutant(
        "diagnosis/linear.py",
        "np.where(spectrum.held, 1.0, 0.0)",
        "np.where(spectrum.held, 0.0, 0.0)",
        _S + "test_what_is_held_moves_as_far_as_its_range_only",
    ),
    Mutant(
        "diagnosis/score.py",
        "(1.0 + g) - m * np.log1p(g))",
        "(1.0 + g) - np.log1p(g))",
        _S + "test_evidence_is_the_integral_over_sizes",
    ),
    Mutant(
        "diagnosis/linear.py",
        "/ np.sqrt(1 - share**2)",
        "/ (1 - share**2)",
        _S + "test_noise_with_a_memory_is_white_afterwards",
    ),
    Mutant(
        "diagnosis/linear.py",
        "return x - a @ solved(factor, a.T @ x)",
        "return x + a @ cho_solve(factor, a.T @ x)",
        _SCORES,
    ),
    Mutant(
        "diagnosis/score.py", "(self.gradient**2 / self.information)", "(self.gradient**2 * self.information)", _SCORES
    ),
    Mutant("diagnosis/score.py", "np.sqrt(NONCENTRALITY / information)", "NONCENTRALITY / information", _SCORES),
    Mutant("diagnosis/alpha.py", "0.6 * self.total", "3.0 * self.total", _S + "test_the_parts_of_alpha_are_the_whole"),
    Mutant(
        "diagnosis/search.py",
        "critical_p(draws, options.parts.catalogue)",
        "critical_p(draws, 5 * options.parts.catalogue)",
        _S + "test_a_search_spends_the_catalogues_part_of_alpha",
    ),
    Mutant(
        "diagnosis/threshold.py",
        "np.quantile(smallest, alpha)",
        "np.quantile(smallest, 1 - alpha)",
        _LINEAR + "test_critical_p_lies_between_bonferroni_and_a_single_test",
    ),
    Mutant(
        "diagnosis/outlying_rows.py",
        "np.maximum(_heavy_p(statistic, count, f), normal_p)",
        "normal_p",
        _LINEAR + "test_tails_decide_how_far_off_a_row_must_be",
    ),
    Mutant("diagnosis/groups.py", "spread[name] > least", "spread[name] > 0", "tests/test_folds.py"),
    Mutant(
        "calibration/error_budget.py",
        "self.scales.variances @ squares.T + self.scales.noise @ noise",
        "self.scales.variances @ squares.T",
        _S + "test_uncertainty_is_that_of_noise_and_of_offsets_together",
    ),
    Mutant(
        "calibration/step.py",
        "_STEP = 1e-8",
        "_STEP = 1e-1",
        _S + "test_exact_readings_give_exact_parameters_however_wide_the_ranges_are",
    ),
    Mutant(
        "gross_errors/nominal_misfit.py",
        "        shift += float(",
        "        shift -= float(",
        "tests/test_nominal_misfit.py",
    ),
    Mutant(
        "gross_errors/nominal_misfit.py",
        "others and others[0] < _RIVAL * least",
        "False",
        "tests/test_nominal_misfit.py",
    ),
    Mutant(
        "diagnosis/experiment_design.py",
        "np.linalg.inv(equal + _ROUNDING * np.eye(len(size)))",
        "np.linalg.inv(equal)",
        "tests/test_separable.py",
    ),
    Mutant(
        "diagnosis/rows_by_session.py",
        'right - np.einsum("skba,skb->sa", crossed, local)',
        'right + np.einsum("skba,skb->sa", crossed, local)',
        _ROWS,
    ),
    Mutant(
        "diagnosis/rows_by_session.py",
        "self.shared - self.local @ steps",
        "self.shared + self.local @ steps",
        _ROWS,
    ),
    Mutant("diagnosis/rows_by_session.py", "(acts.sum(axis=0) == 1) & (count > 1)", "acts.sum(axis=0) == 1", _ROWS),
    Mutant(
        "diagnosis/search.py",
        "if not places <= {p.at for p in h.placed}",
        "if places.isdisjoint(p.at for p in h.placed)",
        "tests/test_pictures.py::test_growth_along_a_travel_is_shown_as_a_slope",
    ),
    Mutant(
        "diagnosis/nameless.py",
        " or _is_left_by_named(search, removed, shapes[0], last):",
        ":",
        "tests/test_diagnosis_cases.py::test_a_zero_that_does_not_stay_is_found[scissors-q2]",
    ),
    Mutant(
        "diagnosis/exchanges.py",
        "while len(group.members) > 3:",
        "while len(group.members) > 99:",
        "tests/test_search.py::test_of_a_group_the_members_that_are_needed_stay",
    ),
    Mutant(
        "diagnosis/exchanges.py",
        "((h,) for h in search.near)",
        "((h,) for h in search.near if h.members)",
        "tests/test_search.py::test_one_that_stands_for_two_is_exchanged_for_both",
    ),
    Mutant(
        "diagnosis/exchanges.py",
        "return BETTER + float(shape_gains(search, without, slice(1))[0])",
        "return BETTER",
        "tests/test_search.py::test_what_a_shape_has_beyond_its_formula_is_no_pair_of_others",
    ),
    Mutant(
        "diagnosis/run_diagnosis.py",
        "if alone.shapes and search.accepted else",
        "if False else",
        "tests/test_search.py::test_a_displacement_without_a_name_that_leaves_effects_does_not_stand_for_all",
    ),
    Mutant(
        "diagnosis/linear.py",
        "projected_out(*self._normal, of_first)",
        "self._normal[:2]",
        "tests/test_diagnosis_linear.py",
    ),
    Mutant(
        "diagnosis/hypotheses.py",
        "2 * len(places & acting) > len(places)",
        "len(places & acting) > 0",
        "tests/test_groups.py::test_the_same_effect_spread_otherwise_over_places_is_recognised",
    ),
    Mutant(
        "diagnosis/nameless.py",
        "if shape.statistic > _LEFT_SHARE * named:",
        "if False:",
        "tests/test_unexplained.py::test_a_named_effect_that_explains_much_of_a_shape_does_not_take_its_rest",
    ),
    Mutant(
        "diagnosis/nameless.py",
        "return after if alone is None else",
        "return after if True else",
        "tests/test_unexplained.py::test_a_named_effect_that_explains_much_of_a_shape_does_not_take_its_rest",
    ),
    Mutant(
        "diagnosis/refits.py",
        "if there.solved:",
        "if True:",
        "tests/test_refits.py::test_an_effect_by_which_rows_are_lost_begins_smaller",
    ),
    Mutant(
        "diagnosis/findings.py",
        "+ self.by_held.get(n, 0.0)",
        "",
        "tests/test_commands_report.py::test_causes_have_one_size_and_what_comes_next",
    ),
    Mutant(
        "diagnosis/refine.py",
        "and not h.akin(accepted)]",
        "]",
        "tests/test_groups.py::test_the_runner_up_is_another_cause",
    ),
    Mutant(
        "sheet/results.py",
        "return points.of(~np.isin(points.rows, self.bad_rows))",
        "return points",
        "tests/test_rows_not_judged.py",
    ),
    Mutant("sheet/verdict.py", "sum(not size <= most", "sum(size > most", "tests/test_rows_not_judged.py"),
    Mutant(
        "calibration/estimated_ranges.py", "np.clip(out[index], low, high)", "out[index]", "tests/test_second_order.py"
    ),
    Mutant("calibration/second_order.py", "positive if self.used else None", "positive", "tests/test_second_order.py"),
    Mutant("calibration/second_order.py", "before.T @ residual -", "0.0 -", "tests/test_second_order.py"),
    Mutant("diagnosis/nameless.py", "if share[best] >= _MOST_SHARE and", "if", "tests/test_own_shapes.py"),
    Mutant("diagnosis/nameless.py", "(share > _OWN_SHARE) & (", "(", "tests/test_own_shapes.py"),
    Mutant("loading/covariates.py", "if lagging(model):", "if False:", "tests/test_second_order.py"),
)
