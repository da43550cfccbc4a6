"""Stands in for srun, scontrol, sbatch, qsub and bsub: knows the options that the jobs in launch/ use and no others,
and runs what they start on two ranks. Called as `batch_stub.py COMMAND ARGUMENTS...`; logs its calls to $BATCH_LOG."""

import argparse
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

RANKS = "2"
OPTIONS = {
    "srun": ("--cpu-bind", "--kill-on-bad-exit", "--wait"),
    "sbatch": (
        "--job-name",
        "--nodes",
        "--ntasks-per-node",
        "--gpus-per-node",
        "--cpus-per-task",
        "--time",
        "--signal",
        "--requeue",
        "--open-mode",
        "--output",
    ),
    "qsub": ("-N", "-l", "-j", "-v", "-W"),
    "bsub": ("-J", "-n", "-R", "-W", "-wa", "-wt", "-Q", "-o"),
}
SWITCHES = ("--requeue",)
DIRECTIVES = {"sbatch": "#SBATCH", "qsub": "#PBS", "bsub": "#BSUB"}


def parse(command: str, words: list[str]) -> tuple[dict, list[str]]:
    """Options by name, those given several times as a list, and what follows them."""
    parser = argparse.ArgumentParser(prog=command, allow_abbrev=False)
    for option in OPTIONS[command]:
        action = {"action": "store_true"} if option in SWITCHES else {"action": "append", "default": []}
        parser.add_argument(option, dest=option.lstrip("-"), **action)
    parser.add_argument("rest", nargs=argparse.REMAINDER)
    options = vars(parser.parse_args(words))
    return options, options.pop("rest")


def directives(command: str, script: str) -> dict:
    """The options in the head of a job script."""
    marks = re.findall(rf"^{DIRECTIVES[command]} (.*)$", script, re.MULTILINE)
    options, rest = parse(command, [word for mark in marks for word in shlex.split(mark)])
    assert not rest, rest
    return options


def submit(script: Path | str, words: list[str], environment: dict[str, str]) -> int:
    """Run a job script, or its text, as the first process of a job."""
    command = ["bash", script, *words] if isinstance(script, Path) else ["bash", "-s", *words]
    text = None if isinstance(script, Path) else script
    job = {**os.environ, **environment, "INSIDE_A_JOB": "1"}
    return subprocess.run(command, input=text, env=job, text=True).returncode


def sbatch(words: list[str]) -> int:
    script = Path(words[0])
    options = directives("sbatch", script.read_text())
    log("sbatch", options)
    return submit(script, words[1:], {"SLURM_JOB_ID": "4711", "SLURM_CPUS_PER_TASK": options["cpus-per-task"][0]})


def srun(words: list[str]) -> int:
    options, command = parse("srun", words)
    log("srun", options, {"gpu_bind": os.environ.get("SLURM_GPU_BIND"), "cpus": os.environ["SRUN_CPUS_PER_TASK"]})
    return subprocess.run(["mpiexec", "-n", RANKS, *command]).returncode


def scontrol(words: list[str]) -> int:
    log("scontrol", words)
    return 0


def qsub(words: list[str]) -> int:
    given, (script,) = parse("qsub", words)
    log("qsub", directives("qsub", Path(script).read_text()), given)
    if "INSIDE_A_JOB" in os.environ:  # it waits for the end of this one
        return 0
    variables = dict(word.split("=") for word in given["v"][0].split(","))
    nodes = Path(os.environ["BATCH_LOG"]).with_name("nodes")
    nodes.write_text("localhost\n" * int(RANKS))
    job = {"PBS_O_WORKDIR": os.getcwd(), "PBS_JOBID": "4711.server", "PBS_NODEFILE": str(nodes)}
    return submit(Path(script), [], variables | job)


def bsub(words: list[str]) -> int:
    assert not words, words
    script = sys.stdin.read()
    log("bsub", directives("bsub", script))
    return submit(script, [], {"LSB_DJOB_NUMPROC": RANKS, "LSB_JOBID": "4711"})


def log(*call) -> None:
    with Path(os.environ["BATCH_LOG"]).open("a") as file:
        file.write(json.dumps(call) + "\n")


if __name__ == "__main__":
    sys.exit(
        {"sbatch": sbatch, "srun": srun, "scontrol": scontrol, "qsub": qsub, "bsub": bsub}[sys.argv[1]](sys.argv[2:])
    )
