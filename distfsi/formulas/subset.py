"""Words of the formula subset that plain Python does not have under that name."""

static_range = range  # a loop over it is unrolled when the formulas are emitted
