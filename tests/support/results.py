"""What a run leaves behind, to compare."""

NO_RESULT = ("balance.csv", "performance.csv")


def results(directory):
    """The bytes of all files of results in a directory, by name; how long the work takes and how evenly ranks share it
    is no result, and those of earlier runs are not looked at."""
    paths = [path for kind in ("*.csv", "*.vtkhdf", "*.series") for path in directory.rglob(kind)]
    named = {str(path.relative_to(directory)): path for path in paths if path.name not in NO_RESULT}
    return {name: path.read_bytes() for name, path in named.items() if not name.startswith("earlier-")}
