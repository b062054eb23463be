"""What `observability --json` writes."""

from __future__ import annotations

from pkmcal_cli.report.outputs.keys import Output

OBSERVABILITY = Output(
    "observability",
    """
verdict determined|partly_determined|nothing_determined: of the selected parameters, which the positions determine
tool_point text?: point whose poses a grid or table gives; null if the table gives actuator positions
n_failed integer: number of points of a grid that are skipped
failed[].file text?: such a point (at most 1000 are listed): null
failed[].line integer: index of the point
failed[].id text?: null
failed[].reason text: why it is skipped
n_rows integer: number of positions
n_values integer: number of values to be measured
condition_number number?: of the paper's Js (range-scaled Jacobian of the positions); null if infinite or if other
    kinds are measured too
condition_number_whitened number?: of the range-scaled, whitened Jacobian; null if infinite
rank integer: number of observable combinations, by the ranges of the machine file, as all keys here
singular_values[] number: of the whitened Jacobian, largest first; 1/s is the standard uncertainty of a combination in
    ranges
O1 number?: geometric mean of the singular values over the root of `n_values` (Borm and Menq); 0 without full rank, as
    O2 to O5
O2 number?: inverse condition number (Driels and Pathre)
O3 number?: smallest singular value (Nahvi and Hollerbach)
O4 number?: noise amplification index (Nahvi and Hollerbach)
O5 number?: inverse of the sum of inverse singular values (Sun and Hollerbach)
parameters[].name text: a parameter
parameters[].std number?: expected standard uncertainty in `unit`; null if undetermined
parameters[].unit text: its unit
undetermined[].kind text?: `null` (not observable) or `weak` (weakly determined)
undetermined[].parameters.NAME number: a motion that the data do not determine, in ranges; every such motion is listed
undetermined[].text text: the same in words
undetermined[].hold[] text: parameters to hold so that the rest is determined; the same for motions that share
    parameters
undetermined[].std_in_ranges number?: of a weak combination, in ranges; null for `null`
undetermined[].std_by_data_alone number?: of a weak combination, by itself: standard uncertainty in terms of its
    strongest member, `hold[0]`, by the data alone; null for `null`
undetermined[].std_with_range number?: the same with its range
undetermined[].determined[] any: empty here; see `calibrate`
datum?[] text: parameters held because the data do not locate the base; null if they do
gauge[] text: unobservable motions of the base, in words
parameters[].std_of_data number?: standard uncertainty from the data alone, with weak directions free
""",
)
