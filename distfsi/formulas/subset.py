"""Words of the formula subset that plain Python does not have under that name."""

static_range = range  # a loop over it is unrolled when the formulas are emitted


class Varying:
    """A number of a scene that changes while it is computed: a kernel gets the `value` of the moment."""

    def __init__(self) -> None:
        self.value = 0.0
