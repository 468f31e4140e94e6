#!/usr/bin/env python3
"""Run the job file of a campaign through the Python client of HyperQueue, and wait for its end.

    gusset campaign submit ida --engine hyperqueue     # writes ida/hyperqueue.toml
    pip install hyperqueue                             # this client; it brings no command hq
    tools/hyperqueue/run.py ida/hyperqueue.toml        # on the running server of this user
    tools/hyperqueue/run.py ida/hyperqueue.toml --local 2

`--local N` starts a server and one worker with N cores in this process. They end with it. Exits with 1 if a task fails: its
error is on stderr. Needs Python 3.11.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import tomllib
from hyperqueue import Client, Job, LocalCluster
from hyperqueue.cluster import WorkerConfig

KEYS = {"id", "command", "cwd", "stdout", "stderr"}


def read(path):
    """The job of a job definition file with the keys that `gusset campaign submit` writes, and the numbers of its tasks."""
    described = tomllib.loads(path.read_text())
    job = Job(name=described["name"], max_fails=None)
    numbers = {}
    for task in described["task"]:
        unknown = set(task) - KEYS
        if unknown:
            sys.exit(f"{path}: this script does not know the keys {sorted(unknown)} of a task")
        output = {key: None if task[key] == "none" else task[key] for key in ("stdout", "stderr")}
        made = job.program(task["command"], cwd=task["cwd"], **output)
        numbers[made.task_id] = task["id"]
    return job, numbers


def run(client, job, numbers):
    """Submits the job and waits. Returns the exit code."""
    submitted = client.submit(job)
    if client.wait_for_jobs([submitted], raise_on_error=False):
        return 0
    for task, failed in client.get_failed_tasks(submitted).items():
        print(f"task {numbers[task]}: {failed.error} See {failed.stderr}", file=sys.stderr)
    return 1


def main():
    parser = argparse.ArgumentParser(description="Run a job file of gusset through the Python client of HyperQueue.")
    parser.add_argument("file", type=Path, help="hyperqueue.toml of a campaign folder")
    parser.add_argument("--local", type=int, metavar="N", help="start a cluster with N cores in this process")
    parser.add_argument("--server-dir", type=Path, help="folder of the running server")
    arguments = parser.parse_args()
    job, numbers = read(arguments.file)
    if arguments.local is None:
        return run(Client(arguments.server_dir), job, numbers)
    with tempfile.TemporaryDirectory() as folder:
        worker = WorkerConfig(cores=arguments.local)
        with LocalCluster(server_dir=folder, worker_config=worker) as cluster:
            return run(cluster.client(), job, numbers)


if __name__ == "__main__":
    sys.exit(main())
