"""What a cell is to a coupling."""

# Fluid; fluid since this step; not looked at yet; behind the wall; farther behind it than fluxes look. Those from
# COVERED on are behind it. The immersed boundary has all of them, cut cells have FLUID and COVERED cells, and ISOLATED
# ones: what is left of the fluid in them has no open face.
FLUID, FRESH, UNKNOWN, COVERED, DEEP = range(5)
ISOLATED = DEEP
